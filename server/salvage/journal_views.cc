#include "server/salvage/journal_views.h"

#include <array>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <string_view>
#include <vector>

#include "core/base/message.h"
#include "server/storage/sqlite.h"

namespace stellate::server {
namespace {

using core::Message;

// SQLite's formats, as its documents "Database File Format" and "WAL-mode File Format" have them.
constexpr std::size_t kLogHeaderBytes = 32, kFrameHeaderBytes = 24;
constexpr std::size_t kPageBytes = 4096;  // of every journal
constexpr std::size_t kPagesAt = 28, kChangesAt = 24, kChangesOfPagesAt = 92;
constexpr std::uint64_t kMostPages = std::uint64_t{1} << 30;

using Sums = std::array<std::uint32_t, 2>;

std::uint32_t Big(const char* at) {
  std::uint32_t number = 0;
  for (int i = 0; i < 4; ++i) number = number << 8 | static_cast<unsigned char>(at[i]);
  return number;
}

std::uint32_t Little(const char* at) {
  std::uint32_t number = 0;
  for (int i = 3; i >= 0; --i) number = number << 8 | static_cast<unsigned char>(at[i]);
  return number;
}

Sums SumOf(std::string_view bytes, Sums sums) {
  for (std::size_t at = 0; at + 8 <= bytes.size(); at += 8) {
    sums[0] += Little(bytes.data() + at) + sums[1];
    sums[1] += Little(bytes.data() + at + 4) + sums[0];
  }
  return sums;
}

// Where one page of the log goes.
struct Frame {
  std::uint64_t at = 0;  // of the page, in the log
  std::uint32_t page = 0;
  bool good = false;  // its sum is right, going by the sum that the frame before it has
};

// Those of the log's last run, up to its last commit.
std::vector<Frame> FramesOf(const std::string& path) {
  std::ifstream log(path, std::ios::binary);
  std::string header(kLogHeaderBytes, '\0'), frame(kFrameHeaderBytes + kPageBytes, '\0');
  if (!log.read(header.data(), kLogHeaderBytes)) return {};
  std::vector<Frame> frames;
  std::size_t committed = 0;
  std::string salt = header.substr(16, 8);
  Sums sums{Big(&header[24]), Big(&header[28])};
  int strangers = 0;
  for (std::uint64_t at = kLogHeaderBytes; log.read(frame.data(), frame.size());
       at += frame.size()) {
    // A header that is damaged does not tell the salt; one frame that is does not end the run, but
    // what an earlier run left does.
    if (frames.empty() && frame.substr(8, 8) != salt) salt = frame.substr(8, 8);
    const bool strange = frame.substr(8, 8) != salt;
    strangers = strange ? strangers + 1 : 0;
    if (strangers > 1) break;
    const std::string_view bytes = frame;
    const Sums due = SumOf(bytes.substr(kFrameHeaderBytes), SumOf(bytes.substr(0, 8), sums));
    sums = {Big(&frame[16]), Big(&frame[20])};
    const std::uint32_t page = Big(&frame[0]);
    frames.push_back({at + kFrameHeaderBytes, page, !strange && due == sums});
    if (Big(&frame[4]) != 0 && !strange) committed = frames.size();
  }
  frames.resize(committed);
  return frames;
}

bool WriteAt(std::fstream* file, std::uint64_t at, const std::string& bytes) {
  file->seekp(static_cast<std::streamoff>(at));
  file->write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  return file->good();
}

bool Apply(const std::string& log_path, const std::vector<Frame>& frames, bool good_alone,
           std::fstream* view) {
  std::ifstream log(log_path, std::ios::binary);
  std::string page(kPageBytes, '\0');
  for (const Frame& frame : frames) {
    if ((good_alone && !frame.good) || frame.page == 0 || frame.page > kMostPages) continue;
    log.seekg(static_cast<std::streamoff>(frame.at));
    if (!log.read(page.data(), kPageBytes)) return false;
    if (!WriteAt(view, (frame.page - std::uint64_t{1}) * kPageBytes, page)) return false;
  }
  return true;
}

// So that SQLite reads it without a log, and counts its pages by its size.
bool SetAlone(const std::string& first_page, bool replace, std::fstream* view) {
  if (replace && !WriteAt(view, 0, first_page)) return false;
  return WriteAt(view, kSqliteFormatAt, std::string(2, '\1')) &&
         WriteAt(view, kPagesAt, std::string(4, '\0')) &&
         WriteAt(view, kChangesAt, std::string(4, '\1')) &&
         WriteAt(view, kChangesOfPagesAt, std::string(4, '\2'));
}

}  // namespace

core::Status MakeJournalView(const JournalView& view, const std::string& journal,
                             const std::string& log, const std::string& blank,
                             const std::string& path) {
  std::string first_page(kPageBytes, '\0');
  std::ifstream(blank, std::ios::binary).read(first_page.data(), kPageBytes);
  std::error_code error;
  std::filesystem::remove(path, error);
  std::filesystem::copy_file(journal, path, error);
  if (error) std::ofstream(path).put('\0');  // the log may have it all
  std::fstream file(path, std::ios::binary | std::ios::in | std::ios::out);
  if ((!view.with_log || Apply(log, FramesOf(log), view.good_frames_alone, &file)) &&
      SetAlone(first_page, view.new_first_page, &file)) {
    return core::Status::Ok();
  }
  return {core::StatusCode::kFailedPrecondition,
          Message("cannot write ", path, ": is there room on the disk?")};
}

}  // namespace stellate::server
