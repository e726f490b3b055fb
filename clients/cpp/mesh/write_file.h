#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "stellate/error.h"

namespace stellate::client {

// A file that is written piece by piece beside the path, and takes its place when it is whole.
// What is not finished leaves no trace, and the old file; also where the process is killed, if the
// file system has files without names. Errors are kFileFailed, with the system's
// reason.
//
//   Expected<Draft> draft = Draft::Begin(path);
//   if (auto ok = draft->Write(bytes); !ok) return ok;
//   return draft->Finish();
class Draft {
 public:
  static Expected<Draft> Begin(const std::string& path);
  ~Draft();
  Draft(Draft&& other) noexcept;
  Draft& operator=(Draft&&) = delete;

  // A pipe or a device: written as it is, since nothing may take its place, and in order.
  static bool IsSpecial(const std::string& path);

  Expected<void> Write(std::string_view bytes) { return WriteAt(end_, bytes); }  // at the end
  // Beyond the end leaves zeros between.
  Expected<void> WriteAt(std::uint64_t place, std::string_view bytes);
  // Sees that what was written is on the disk. Finish does, too.
  Expected<void> Keep();
  Expected<void> Finish();

 private:
  Draft(std::string path, std::string target, std::string draft, int file, bool has_name)
      : path_(std::move(path)),
        target_(std::move(target)),
        draft_(std::move(draft)),
        file_(file),
        has_name_(has_name) {}
  void Drop();

  std::string path_, target_, draft_;  // the last empty: written as it is
  int file_ = -1;
  bool has_name_ = false;  // draft_; else that is for a moment before it takes its place
  std::uint64_t end_ = 0;
};

// Puts the bytes in the place of whatever was there, whole or not at all.
Expected<void> WriteFile(const std::string& path, std::string_view bytes);

// kFileFailed where WriteFile could not even begin.
Expected<void> CheckWrite(const std::string& path);

}  // namespace stellate::client
