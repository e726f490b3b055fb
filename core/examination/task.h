#pragma once

#include <coroutine>
#include <exception>
#include <optional>
#include <utility>

namespace stellate::core::examination {

template <typename T>
class Task;

// What the promises of all tasks have: where to go on when the task is over.
struct TaskPromise {
  struct Return {
    bool await_ready() const noexcept { return false; }
    template <typename Promise>
    std::coroutine_handle<> await_suspend(std::coroutine_handle<Promise> ended) const noexcept {
      const std::coroutine_handle<> caller = ended.promise().caller;
      return caller ? caller : std::noop_coroutine();
    }
    void await_resume() const noexcept {}
  };

  std::suspend_always initial_suspend() const noexcept { return {}; }
  Return final_suspend() const noexcept { return {}; }
  void unhandled_exception() { error = std::current_exception(); }
  void Rethrow() const {
    if (error) std::rethrow_exception(error);
  }

  std::coroutine_handle<> caller;  // none: it was begun by Resume
  std::exception_ptr error;
};

template <typename T>
struct ValuePromise : TaskPromise {
  void return_value(T result) { value = std::move(result); }
  T Take() {
    Rethrow();
    return std::move(*value);
  }

  std::optional<T> value;
};

template <>
struct ValuePromise<void> : TaskPromise {
  void return_void() const {}
  void Take() const { Rethrow(); }
};

// A computation that stops where it needs answers, and goes on when it has them. It begins when it
// is awaited; what it throws, its caller catches.
//
//   Task<double> Distance(Eigen::MatrixXd x) {  // parameters by value: they outlive the caller's
//     const Answered y = co_await probe.Closest(x);
//     co_return (y.points - x).norm();
//   }
template <typename T = void>
class [[nodiscard]] Task {
 public:
  struct Promise : ValuePromise<T> {
    Task get_return_object() { return Task(std::coroutine_handle<Promise>::from_promise(*this)); }
  };
  using promise_type = Promise;  // as the language calls it

  Task(Task&& other) noexcept : handle_(std::exchange(other.handle_, {})) {}
  Task& operator=(Task&& other) noexcept {
    std::swap(handle_, other.handle_);
    return *this;
  }
  ~Task() {
    if (handle_) handle_.destroy();
  }

  bool await_ready() const noexcept { return false; }
  std::coroutine_handle<> await_suspend(std::coroutine_handle<> caller) noexcept {
    handle_.promise().caller = caller;
    return handle_;
  }
  T await_resume() { return handle_.promise().Take(); }

  // Begins a task that is awaited by none.
  void Begin() { handle_.resume(); }
  bool is_over() const { return handle_.done(); }
  T result() { return handle_.promise().Take(); }  // REQUIRES: it is over

 private:
  explicit Task(std::coroutine_handle<Promise> handle) : handle_(handle) {}

  std::coroutine_handle<Promise> handle_;
};

}  // namespace stellate::core::examination
