#pragma once

#include <sys/types.h>

#include <chrono>
#include <memory>
#include <string>

namespace stellate::pipe {

// A file descriptor that is closed with its owner.
class Descriptor {
 public:
  Descriptor() = default;
  explicit Descriptor(int number) : number_(number) {}
  Descriptor(Descriptor&& other) noexcept : number_(other.Release()) {}
  Descriptor& operator=(Descriptor&& other) noexcept {
    Close();
    number_ = other.Release();
    return *this;
  }
  ~Descriptor() { Close(); }

  int get() const { return number_; }  // -1: closed
  void Close();

 private:
  int Release() {
    const int number = number_;
    number_ = -1;
    return number;
  }
  int number_ = -1;
};

// A command of the shell, in a process group of its own, with pipes to its standard streams. The
// pipes' ends here do not block.
class Process {
 public:
  // Throws std::system_error when the system has no process or no pipe left.
  explicit Process(const std::string& command);
  // Ends it as by End.
  ~Process();
  Process(const Process&) = delete;
  Process& operator=(const Process&) = delete;

  Descriptor input, output, errors;  // its standard input, output and error
  std::string unread;                // of its output

  // Reads what its standard error has. False at its end.
  bool ReadErrors();
  // The last of what it wrote there, for a message; empty or starting on a line of its own.
  std::string LastErrors() const;

  enum class Manner { kInOrder, kNow };
  // Ends it and all that it started. In order: its input ends, and it has two seconds to do so too.
  // Then, or now: SIGTERM, and what is left of it after two seconds more, SIGKILL.
  void End(Manner manner);

  // Waits a second for its end. Such as "it ended with status 3"; "it is still there" if it is.
  std::string HowItEnded();
  bool ended_well() const { return ended_ && status_ == 0; }

 private:
  enum class Whose { kItsOwn, kAll };  // its own end, or that of all who hold its output
  bool AwaitEnd(Whose whose, std::chrono::milliseconds patience);

  pid_t pid_ = 0;  // and that of its group
  bool ended_ = false, collected_ = false;
  bool killed_ = false;  // by a signal
  int status_ = 0;       // of its exit, or the signal
  std::string last_errors_;
};

}  // namespace stellate::pipe
