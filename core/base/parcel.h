#pragma once

#include <cstddef>
#include <cstring>
#include <span>
#include <type_traits>
#include <vector>

namespace stellate::core {

// Messages of numbers between the parts of a mesh (core/peers.h). Write them in some order, and
// read them in the same order:
//
//   std::vector<std::byte> message;
//   Pack(7, &message);
//   PackAll(ids, &message);
//   Parcel parcel(message);
//   const int seven = parcel.Unpack<int>();
//   parcel.UnpackAll(&ids);
//
// A message holds no types: what is read as something else than was written is nonsense.

// Appends numbers to a message, as they lie in memory: all parts run the same program.
template <typename Number>
void Pack(std::span<const Number> numbers, std::vector<std::byte>* message) {
  static_assert(std::is_trivially_copyable_v<Number>);
  const auto bytes = std::as_bytes(numbers);
  message->insert(message->end(), bytes.begin(), bytes.end());
}

// Appends one number.
template <typename Number>
void Pack(const Number& number, std::vector<std::byte>* message) {
  Pack(std::span<const Number>(&number, 1), message);
}

// Appends numbers after their count, so that UnpackAll knows how many to read.
template <typename Number>
void PackAll(const std::vector<Number>& numbers, std::vector<std::byte>* message) {
  Pack(numbers.size(), message);
  Pack(std::span<const Number>(numbers), message);
}

// Reads what was packed, in the same order. It holds its place in the message: each call goes on
// where the last one ended.
class Parcel {
 public:
  // The message is borrowed.
  explicit Parcel(const std::vector<std::byte>& message) : rest_(message) {}

  bool is_empty() const { return rest_.empty(); }
  // Reads `count` numbers. REQUIRES: as many are left
  template <typename Number>
  void Unpack(std::size_t count, Number* to) {
    static_assert(std::is_trivially_copyable_v<Number>);
    const std::size_t bytes = count * sizeof(Number);
    if (bytes > 0) std::memcpy(to, rest_.data(), bytes);
    rest_ = rest_.subspan(bytes);
  }
  // Reads one number.
  template <typename Number>
  Number Unpack() {
    Number number;
    Unpack(1, &number);
    return number;
  }
  // Reads what PackAll wrote, in place of what is there.
  template <typename Number>
  void UnpackAll(std::vector<Number>* numbers) {
    numbers->resize(Unpack<std::size_t>());
    Unpack(numbers->size(), numbers->data());
  }

 private:
  std::span<const std::byte> rest_;
};

}  // namespace stellate::core
