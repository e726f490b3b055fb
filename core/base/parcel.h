#pragma once

#include <cstddef>
#include <cstring>
#include <span>
#include <type_traits>
#include <vector>

namespace stellate::core {

// Appends numbers to a message, as they lie in memory: all parts run the same program.
template <typename Number>
void Pack(std::span<const Number> numbers, std::vector<std::byte>* message) {
  static_assert(std::is_trivially_copyable_v<Number>);
  const auto bytes = std::as_bytes(numbers);
  message->insert(message->end(), bytes.begin(), bytes.end());
}

template <typename Number>
void Pack(const Number& number, std::vector<std::byte>* message) {
  Pack(std::span<const Number>(&number, 1), message);
}

// With their count.
template <typename Number>
void PackAll(const std::vector<Number>& numbers, std::vector<std::byte>* message) {
  Pack(numbers.size(), message);
  Pack(std::span<const Number>(numbers), message);
}

// Reads what was packed, in the same order.
class Parcel {
 public:
  // The message is borrowed.
  explicit Parcel(const std::vector<std::byte>& message) : rest_(message) {}

  bool is_empty() const { return rest_.empty(); }
  // REQUIRES: as many are left
  template <typename Number>
  void Unpack(std::size_t count, Number* to) {
    static_assert(std::is_trivially_copyable_v<Number>);
    const std::size_t bytes = count * sizeof(Number);
    if (bytes > 0) std::memcpy(to, rest_.data(), bytes);
    rest_ = rest_.subspan(bytes);
  }
  template <typename Number>
  Number Unpack() {
    Number number;
    Unpack(1, &number);
    return number;
  }
  // What PackAll wrote.
  template <typename Number>
  void UnpackAll(std::vector<Number>* numbers) {
    numbers->resize(Unpack<std::size_t>());
    Unpack(numbers->size(), numbers->data());
  }

 private:
  std::span<const std::byte> rest_;
};

}  // namespace stellate::core
