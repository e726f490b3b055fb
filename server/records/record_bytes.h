#pragma once

#include <Eigen/Core>
#include <bit>
#include <cstdint>
#include <cstring>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

namespace stellate::server {

static_assert(std::endian::native == std::endian::little, "records are copied, not converted");

// How records are laid out: little-endian numbers of 8 bytes, strings and arrays after their sizes.
inline constexpr std::size_t kWord = 8;

// A checksum of words that changes with any one of them. Guards against disks, not against forgers.
//
//   RecordDigest digest;
//   digest.Add(points);
//   if (digest.value() != recorded) ...  // the record is damaged
class RecordDigest {
 public:
  void Add(std::uint64_t word) {
    state_ = (state_ ^ word) * 0xff51afd7ed558ccdu;
    state_ ^= state_ >> 32;
  }
  // The last bytes make a word of their own, filled up by zeros; the size, which is added first,
  // tells them apart.
  void Add(const void* data, std::size_t bytes) {
    Add(bytes);
    const char* at = static_cast<const char*>(data);
    for (; bytes >= kWord; at += kWord, bytes -= kWord) {
      std::uint64_t word;
      std::memcpy(&word, at, kWord);
      Add(word);
    }
    std::uint64_t rest = 0;
    if (bytes > 0) std::memcpy(&rest, at, bytes);
    Add(rest);
  }
  void Add(const Eigen::Ref<const Eigen::MatrixXd>& matrix) {
    Add(static_cast<std::uint64_t>(matrix.rows()));
    Add(matrix.data(), static_cast<std::size_t>(matrix.size()) * sizeof(double));
  }
  void Add(const std::vector<std::uint8_t>& bytes) { Add(bytes.data(), bytes.size()); }
  std::uint64_t value() const { return state_; }

 private:
  std::uint64_t state_ = 0x9e3779b97f4a7c15u;
};

// RecordWriter and RecordReader have the same members, so that one function lists the fields of a
// record, once and in their order, for both directions.
//
//   template <typename Record, typename Fields>
//   void LayOut(Record& record, Fields& fields) {
//     fields.Number(record.round);
//     fields.Numbers(record.points);
//   }
//   RecordWriter writer;
//   LayOut(record, writer);
//   file.Append(writer.Take());
//
//   RecordReader reader(bytes);
//   LayOut(record, reader);
//   if (!reader.Complete()) ...  // damaged, or of another version
class RecordWriter {
 public:
  template <typename T>
  void Number(const T& value) {
    static_assert(sizeof(T) <= kWord);
    if constexpr (std::is_floating_point_v<T>) {
      Word(std::bit_cast<std::uint64_t>(static_cast<double>(value)));
    } else {
      Word(static_cast<std::uint64_t>(value));
    }
  }
  void Bytes(const std::string& bytes) { Array(bytes.data(), bytes.size()); }
  void Bytes(const std::vector<std::uint8_t>& bytes) { Array(bytes.data(), bytes.size()); }
  void Bytes(const std::vector<std::int8_t>& bytes) { Array(bytes.data(), bytes.size()); }
  template <typename Id>
  void Ids(const std::vector<Id>& ids) {
    Array(ids.data(), ids.size() * sizeof(ids[0]));
  }
  void Strings(const std::vector<std::string>& strings) {
    Number(strings.size());
    for (const std::string& string : strings) Bytes(string);
  }
  template <typename Matrix>
  void Numbers(const Matrix& matrix) {
    Number(matrix.rows());
    Array(matrix.data(), static_cast<std::size_t>(matrix.size()) * sizeof(double));
  }
  // Of a block of answers: numbers, or flags.
  template <typename Array>
  void Field(const Array& array) {
    if constexpr (std::is_same_v<Array, std::vector<std::uint8_t>>)
      Bytes(array);
    else
      Numbers(array);
  }
  // A value that may be missing, after whether it is there.
  template <typename T>
  void Maybe(const std::optional<T>& value) {
    Number(value.has_value());
    if (value) Number(*value);
  }
  // Whether a part follows that not every record has: `if (fields.Has(x != nullptr)) ...`.
  bool Has(bool value) {
    Number(value);
    return value;
  }

  std::size_t size() const { return out_.size(); }
  std::string Take() { return std::move(out_); }

 private:
  void Word(std::uint64_t word) { out_.append(reinterpret_cast<const char*>(&word), sizeof(word)); }
  void Array(const void* data, std::size_t bytes) {
    Number(bytes);
    if (bytes > 0) out_.append(static_cast<const char*>(data), bytes);
  }
  std::string out_;
};

// Reads what RecordWriter wrote. Bytes that are no such record leave values empty and good() false:
// a caller asks once, at the end. Sizes are believed as far as there are bytes.
class RecordReader {
 public:
  explicit RecordReader(std::string_view in) : in_(in) {}

  template <typename T>
  void Number(T& value) {
    const std::uint64_t word = Word();
    if constexpr (std::is_floating_point_v<T>) {
      value = std::bit_cast<double>(word);
    } else {
      value = static_cast<T>(word);
    }
  }
  template <typename Container>
  void Bytes(Container& bytes) {
    const std::string_view data = Array();
    bytes.assign(data.begin(), data.end());
  }
  template <typename Id>
  void Ids(std::vector<Id>& ids) {
    const std::string_view data = Array();
    good_ = good_ && data.size() % sizeof(ids[0]) == 0;
    ids.resize(good_ ? data.size() / sizeof(ids[0]) : 0);
    if (!ids.empty()) std::memcpy(ids.data(), data.data(), data.size());
  }
  void Strings(std::vector<std::string>& strings) {
    std::uint64_t count = 0;
    Number(count);
    strings.clear();
    for (std::uint64_t i = 0; i < count && good_; ++i) Bytes(strings.emplace_back());
  }
  template <typename Matrix>
  void Numbers(Matrix& matrix) {
    std::uint64_t rows = 0;
    Number(rows);
    const std::string_view data = Array();
    const std::size_t size = data.size() / sizeof(double);
    if (rows > std::numeric_limits<Eigen::Index>::max() || data.size() % sizeof(double) != 0 ||
        (rows == 0 ? size != 0 : size % rows != 0)) {
      good_ = false;
    }
    if constexpr (Matrix::ColsAtCompileTime == 1) good_ = good_ && size == rows;
    if (!good_) return;
    if constexpr (Matrix::ColsAtCompileTime == 1) {
      matrix.resize(static_cast<Eigen::Index>(rows));
    } else {
      matrix.resize(static_cast<Eigen::Index>(rows),
                    rows == 0 ? 0 : static_cast<Eigen::Index>(size / rows));
    }
    if (size > 0) std::memcpy(matrix.data(), data.data(), data.size());
  }
  template <typename Array>
  void Field(Array& array) {
    if constexpr (std::is_same_v<Array, std::vector<std::uint8_t>>)
      Bytes(array);
    else
      Numbers(array);
  }
  template <typename T>
  void Maybe(std::optional<T>& value) {
    value.reset();
    if (!Has(false)) return;
    T read{};
    Number(read);
    value = read;
  }
  bool Has(bool) {
    bool has = false;
    Number(has);
    return has && good_;
  }

  // Whether all fields so far were there.
  bool good() const { return good_; }
  // Whether all were there, and nothing follows them.
  bool Complete() const { return good_ && in_.empty(); }

 private:
  std::uint64_t Word() {
    std::uint64_t word = 0;
    if (in_.size() < kWord) {
      good_ = false;
      return 0;
    }
    std::memcpy(&word, in_.data(), kWord);
    in_.remove_prefix(kWord);
    return word;
  }
  std::string_view Array() {
    const std::uint64_t bytes = Word();
    if (bytes > in_.size()) {
      good_ = false;
      return {};
    }
    const std::string_view data = in_.substr(0, bytes);
    in_.remove_prefix(bytes);
    return data;
  }

  std::string_view in_;
  bool good_ = true;
};

}  // namespace stellate::server
