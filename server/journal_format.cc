#include "server/journal_format.h"

#include <algorithm>
#include <bit>
#include <cstring>
#include <limits>
#include <type_traits>
#include <utility>

namespace stellate::server {
namespace {

static_assert(std::endian::native == std::endian::little, "records are copied, not converted");

using Eigen::Index;
using Microseconds = std::chrono::microseconds;
using SystemTime = std::chrono::system_clock::time_point;

constexpr std::size_t kWord = 8;

class Digest {
 public:
  void Add(std::uint64_t word) {
    state_ = (state_ ^ word) * 0xff51afd7ed558ccdu;
    state_ ^= state_ >> 32;
  }
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
  std::uint64_t value() const { return state_; }

 private:
  std::uint64_t state_ = 0x9e3779b97f4a7c15u;
};

// Both take the same fields in the same order, so that one function lays out either way.
class Writer {
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
  template <typename Matrix>
  void Numbers(const Matrix& matrix) {
    Number(matrix.rows());
    Array(matrix.data(), static_cast<std::size_t>(matrix.size()) * sizeof(double));
  }
  template <typename T>
  void Maybe(const std::optional<T>& value) {
    Number(value.has_value());
    if (value) Number(*value);
  }
  bool Has(bool value) {
    Number(value);
    return value;
  }

  std::string Take() { return std::move(out_); }

 private:
  void Word(std::uint64_t word) { out_.append(reinterpret_cast<const char*>(&word), sizeof(word)); }
  void Array(const void* data, std::size_t bytes) {
    Number(bytes);
    if (bytes > 0) out_.append(static_cast<const char*>(data), bytes);
  }
  std::string out_;
};

class Reader {
 public:
  explicit Reader(std::string_view in) : in_(in) {}

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
  template <typename Matrix>
  void Numbers(Matrix& matrix) {
    std::uint64_t rows = 0;
    Number(rows);
    const std::string_view data = Array();
    const std::size_t size = data.size() / sizeof(double);
    if (rows > std::numeric_limits<Index>::max() || data.size() % sizeof(double) != 0 ||
        (rows == 0 ? size != 0 : size % rows != 0)) {
      good_ = false;
    }
    if constexpr (Matrix::ColsAtCompileTime == 1) good_ = good_ && size == rows;
    if (!good_) return;
    if constexpr (Matrix::ColsAtCompileTime == 1) {
      matrix.resize(static_cast<Index>(rows));
    } else {
      matrix.resize(static_cast<Index>(rows), rows == 0 ? 0 : static_cast<Index>(size / rows));
    }
    if (size > 0) std::memcpy(matrix.data(), data.data(), data.size());
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

  bool good() const { return good_; }
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

// `Value` is const when writing.
template <typename Archive, typename Value>
void LayOutSpecification(Archive& archive, Value& spec) {
  archive.Number(spec.dimension);
  archive.Number(spec.ambient_dimension);
  archive.Number(spec.epsilon);
  archive.Number(spec.oracle.intersect_flat);
  archive.Number(spec.oracle.tangent_basis);
  archive.Number(spec.oracle.local_size);
  if (archive.Has(spec.bounding_box.has_value())) {
    if constexpr (!std::is_const_v<Value>) spec.bounding_box.emplace();
    archive.Numbers(spec.bounding_box->lower);
    archive.Numbers(spec.bounding_box->upper);
  }
  archive.Numbers(spec.seeds);
  archive.Number(spec.box_seeds);
  archive.Number(spec.components);
  archive.Number(spec.audit);
  archive.Number(spec.random_seed);
  auto& criteria = spec.criteria;
  archive.Number(criteria.radius_edge_bound);
  archive.Maybe(criteria.sliver_bound);
  archive.Number(criteria.picking_radius);
  archive.Number(criteria.small_sliver_radius);
  archive.Maybe(criteria.candidates);
  archive.Maybe(criteria.advance_step);
  archive.Maybe(criteria.judging);
  archive.Number(criteria.ask_ahead);
  archive.Maybe(criteria.size_rate);
  archive.Maybe(criteria.max_deviation);
  archive.Number(criteria.flat_alternations);
  archive.Number(spec.limits.max_vertices);
  archive.Number(spec.limits.max_rounds);
  archive.Number(spec.limits.max_batch_queries);
  archive.Number(spec.threads);
}

std::int64_t ToNumber(SystemTime time) {
  return std::chrono::duration_cast<Microseconds>(time.time_since_epoch()).count();
}

SystemTime ToTime(std::int64_t number) {
  // The clock may count finer: what only a forged record can hold must not overflow it.
  constexpr std::int64_t kFarthest =
      std::chrono::duration_cast<Microseconds>(SystemTime::duration::max()).count();
  return SystemTime(Microseconds(std::clamp(number, -kFarthest, kFarthest)));
}

}  // namespace

std::string EncodeStart(const SessionOptions& options, SystemTime create_time) {
  Writer writer;
  writer.Bytes(options.name);
  writer.Bytes(options.owner);
  writer.Bytes(options.label);
  writer.Number(ToNumber(create_time));
  writer.Number(options.dispatch.answer_limit.count());
  writer.Number(options.dispatch.worker_wait.count());
  LayOutSpecification(writer, options.spec);
  writer.Number(options.dispatch.busy_limit.count());
  return writer.Take();
}

bool DecodeStart(std::string_view record, SessionOptions* options, SystemTime* create_time) {
  Reader reader(record);
  std::int64_t time = 0;
  Clock::rep answer_limit = 0, worker_wait = 0;
  Clock::rep busy_limit = options->dispatch.busy_limit.count();
  reader.Bytes(options->name);
  reader.Bytes(options->owner);
  reader.Bytes(options->label);
  reader.Number(time);
  reader.Number(answer_limit);
  reader.Number(worker_wait);
  LayOutSpecification(reader, options->spec);
  if (!reader.Complete()) reader.Number(busy_limit);  // earlier records end before it
  *create_time = ToTime(time);
  options->dispatch.answer_limit = Clock::duration(answer_limit);
  options->dispatch.worker_wait = Clock::duration(worker_wait);
  options->dispatch.busy_limit = Clock::duration(busy_limit);
  return reader.Complete();
}

std::string EncodeAnswers(const core::Answers& answers) {
  Writer writer;
  writer.Number(answers.blocks.size());
  for (const core::AnswerBlock& block : answers.blocks) {
    writer.Numbers(block.points);
    writer.Bytes(block.found);
    writer.Numbers(block.tangents);
    writer.Numbers(block.sizes);
  }
  return writer.Take();
}

std::optional<core::Answers> DecodeAnswers(std::string_view record) {
  Reader reader(record);
  std::uint64_t blocks = 0;
  reader.Number(blocks);
  core::Answers answers;
  for (std::uint64_t i = 0; i < blocks && reader.good(); ++i) {
    core::AnswerBlock& block = answers.blocks.emplace_back();
    reader.Numbers(block.points);
    reader.Bytes(block.found);
    reader.Numbers(block.tangents);
    reader.Numbers(block.sizes);
  }
  if (!reader.Complete()) return std::nullopt;
  return answers;
}

std::string EncodeEnd(const SessionEnd& end) {
  Writer writer;
  writer.Number(static_cast<int>(end.state));
  writer.Number(ToNumber(end.time));
  writer.Number(end.elapsed_seconds);
  writer.Bytes(end.failure.reason);
  writer.Bytes(end.failure.message);
  writer.Number(end.rounds);
  return writer.Take();
}

std::optional<SessionEnd> DecodeEnd(std::string_view record) {
  Reader reader(record);
  SessionEnd end;
  int state = 0;
  std::int64_t time = 0;
  reader.Number(state);
  reader.Number(time);
  reader.Number(end.elapsed_seconds);
  reader.Bytes(end.failure.reason);
  reader.Bytes(end.failure.message);
  reader.Number(end.rounds);
  end.state = static_cast<SessionState>(state);
  end.time = ToTime(time);
  const bool ended = end.state >= SessionState::kSucceeded && end.state <= SessionState::kFailed;
  if (!reader.Complete() || !ended) return std::nullopt;
  return end;
}

SessionEnd RemovedEnd() { return {SessionState::kCancelled, {}, 0, {"REMOVED", ""}, 0}; }

bool IsRemoved(const SessionEnd& end) {
  const SessionEnd removed = RemovedEnd();
  return end.state == removed.state && end.time == removed.time &&
         end.failure.reason == removed.failure.reason;
}

std::uint64_t DigestOf(const core::QueryBatch& batch) {
  Digest digest;
  digest.Add(batch.round);
  for (const core::QueryBlock& block : batch.blocks) {
    digest.Add(static_cast<std::uint64_t>(block.kind));
    digest.Add(block.want_tangents);
    digest.Add(block.want_sizes);
    digest.Add(block.points);
    digest.Add(block.bases);
    digest.Add(block.radii);
  }
  return digest.value();
}

std::string SealOf(std::string_view record, std::string_view place) {
  Digest digest;
  digest.Add(place.data(), place.size());
  digest.Add(record.data(), record.size());
  const std::uint64_t value = digest.value();
  return {reinterpret_cast<const char*>(&value), sizeof(value)};
}

std::optional<std::string_view> Unseal(std::string_view sealed, std::string_view place) {
  if (sealed.size() < kWord) return std::nullopt;
  const std::string_view record = sealed.substr(0, sealed.size() - kWord);
  if (sealed.substr(record.size()) != SealOf(record, place)) return std::nullopt;
  return record;
}

}  // namespace stellate::server
