#include "server/records/journal_format.h"

#include <algorithm>

#include "server/records/record_bytes.h"

namespace stellate::server {
namespace {

using Eigen::Index;
using Microseconds = std::chrono::microseconds;
using SystemTime = std::chrono::system_clock::time_point;

constexpr std::size_t kPartBytes = std::size_t{1} << 20;  // SQLite copies a large one several times

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
  archive.Maybe(spec.declared_reach);
  archive.Number(spec.cover_box);
  archive.Number(spec.random_seed);
  auto& criteria = spec.criteria;
  archive.Number(criteria.radius_edge_bound);
  archive.Maybe(criteria.sliver_bound);
  archive.Number(criteria.picking_radius);
  archive.Number(criteria.small_sliver_radius);
  archive.Maybe(criteria.candidates);
  archive.Maybe(criteria.advance_step);
  archive.Maybe(criteria.centre_rule);
  archive.Number(criteria.speculative);
  archive.Maybe(criteria.size_rate);
  archive.Maybe(criteria.max_deviation);
  archive.Number(criteria.protection);
  archive.Number(criteria.flat_alternations);
  archive.Number(spec.limits.max_vertices);
  archive.Number(spec.limits.max_rounds);
  archive.Number(spec.limits.max_batch_queries);
  archive.Number(spec.walls);
  archive.Bytes(spec.labels);
  archive.Ids(spec.closures);
  archive.Number(spec.boundary_only);
  archive.Number(spec.oracle.conormals);
}

template <typename Archive, typename Value>
void LayOutPoints(Archive& archive, Value& points) {
  if (!archive.Has(points.has_value())) return;
  if constexpr (!std::is_const_v<Value>) points.emplace();
  archive.Number(points->points);
  archive.Number(points->has_tangents);
  auto& spec = points->spec;
  archive.Number(spec.dimension);
  archive.Number(spec.ambient_dimension);
  archive.Number(spec.closed);
  archive.Maybe(spec.noise);
  archive.Number(spec.drop);
  archive.Maybe(spec.reach);
  archive.Number(spec.weights);
  archive.Number(spec.steiner);
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

// Marks, in the number of a block, that clearances and conormals follow its answers. Arrays that a
// later version adds go behind them, with a mark of their own.
constexpr std::size_t kWithWalls = std::size_t{1} << 62;
constexpr int kFieldsWithoutWalls = 4;

// f(field) for the arrays of an answer that are recorded.
template <typename F>
void ForEachRecorded(bool with_walls, const F& f) {
  int fields = 0;
  core::AnswerBlock::ForEachField([&](auto field) {
    if (fields++ < kFieldsWithoutWalls || with_walls) f(field);
  });
}

template <typename Archive, typename Value>
void LayOutAnswers(Archive& archive, Value& answers, bool with_walls) {
  ForEachRecorded(with_walls, [&](auto field) { archive.Field(answers.*field); });
}

template <typename Archive, typename Value>
void LayOutState(Archive& archive, Value& state) {
  archive.Number(state.identity);
  archive.Number(state.commits);
  archive.Number(state.next_mesh);
  archive.Number(state.records);
  archive.Number(state.sum);
}

template <typename Archive, typename Value>
void LayOutRound(Archive& archive, Value& round) {
  archive.Number(round.questions);
  archive.Number(round.answers);
  archive.Number(round.parts);
  archive.Number(round.standing.vertices);
  archive.Number(round.standing.elapsed_seconds);
}

template <typename Value, typename LayOut>
std::string Encoded(const Value& value, LayOut lay_out) {
  RecordWriter writer;
  lay_out(writer, value);
  return writer.Take();
}

template <typename Value, typename LayOut>
std::optional<Value> Decoded(std::string_view record, LayOut lay_out) {
  RecordReader reader(record);
  Value value;
  lay_out(reader, value);
  if (!reader.Complete()) return std::nullopt;
  return value;
}

}  // namespace

std::uint64_t SealOf(std::string_view record, const Place& place) {
  RecordDigest digest;
  digest.Add(static_cast<std::uint64_t>(place.mesh));
  digest.Add(static_cast<std::uint64_t>(place.kind));
  digest.Add(static_cast<std::uint64_t>(place.number));
  digest.Add(static_cast<std::uint64_t>(place.part));
  digest.Add(record.data(), record.size());
  return digest.value();
}

std::string EncodeState(const JournalState& state) {
  return Encoded(state, [](auto& archive, auto& value) { LayOutState(archive, value); });
}

std::optional<JournalState> DecodeState(std::string_view record) {
  return Decoded<JournalState>(record,
                               [](auto& archive, auto& value) { LayOutState(archive, value); });
}

std::string EncodeStart(const MeshRequest& request, SystemTime create_time) {
  RecordWriter writer;
  writer.Bytes(request.name);
  writer.Bytes(request.owner);
  writer.Bytes(request.label);
  writer.Bytes(request.about);
  writer.Strings(request.region_names);
  writer.Numbers(request.scale);
  writer.Number(ToNumber(create_time));
  writer.Number(request.timeouts.answer_limit.count());
  writer.Number(request.timeouts.worker_wait.count());
  LayOutSpecification(writer, request.spec);
  writer.Number(request.timeouts.busy_limit.count());
  LayOutPoints(writer, request.points);
  writer.Bytes(request.trace.parent);
  writer.Bytes(request.trace.state);
  return writer.Take();
}

bool DecodeStart(std::string_view record, MeshRequest* request, SystemTime* create_time) {
  RecordReader reader(record);
  std::int64_t time = 0;
  Clock::rep answer_limit = 0, worker_wait = 0, busy_limit = 0;
  reader.Bytes(request->name);
  reader.Bytes(request->owner);
  reader.Bytes(request->label);
  reader.Bytes(request->about);
  reader.Strings(request->region_names);
  reader.Numbers(request->scale);
  reader.Number(time);
  reader.Number(answer_limit);
  reader.Number(worker_wait);
  LayOutSpecification(reader, request->spec);
  reader.Number(busy_limit);
  LayOutPoints(reader, request->points);
  reader.Bytes(request->trace.parent);
  reader.Bytes(request->trace.state);
  *create_time = ToTime(time);
  request->timeouts.answer_limit = Clock::duration(answer_limit);
  request->timeouts.worker_wait = Clock::duration(worker_wait);
  request->timeouts.busy_limit = Clock::duration(busy_limit);
  const Index axes = request->scale.size();
  return reader.Complete() && (axes == 0 || axes == request->spec.ambient_dimension);
}

std::vector<AnswerRange> Merged(std::vector<AnswerRange> ranges) {
  std::sort(ranges.begin(), ranges.end());
  std::vector<AnswerRange> merged;
  for (const AnswerRange& range : ranges) {
    if (!merged.empty() && merged.back().block == range.block && merged.back().end >= range.first) {
      merged.back().end = std::max(merged.back().end, range.end);
    } else {
      merged.push_back(range);
    }
  }
  return merged;
}

std::vector<AnswerRange> Missing(const std::vector<AnswerRange>& ranges,
                                 const std::vector<Index>& sizes) {
  std::vector<AnswerRange> missing;
  auto range = ranges.begin();
  for (std::size_t block = 0; block < sizes.size(); ++block) {
    Index next = 0;
    for (; range != ranges.end() && range->block == block; ++range) {
      if (range->first > next) missing.push_back({block, next, range->first});
      next = range->end;
    }
    if (next < sizes[block]) missing.push_back({block, next, sizes[block]});
  }
  return missing;
}

bool EncodeAnswers(const core::Answers& answers, const std::vector<AnswerRange>& ranges,
                   std::uint64_t questions, const std::function<bool(const std::string&)>& take) {
  RecordWriter writer;
  const auto begin = [&] {
    writer = RecordWriter();
    writer.Number(questions);
  };
  begin();
  bool empty = true;
  for (const AnswerRange& range : ranges) {
    const core::AnswerBlock& block = answers.blocks[range.block];
    const std::size_t bytes = std::max<std::size_t>(core::BytesPerQuery(block), 1);
    const auto most = std::max<Index>(static_cast<Index>(kPartBytes / bytes), 1);
    for (Index first = range.first; first < range.end; first += most) {
      const bool with_walls = block.clearances.cols() > 0;
      writer.Number(range.block | (with_walls ? kWithWalls : 0));
      writer.Number(first);
      const core::AnswerBlock some = block.Rows(first, std::min(most, range.end - first));
      LayOutAnswers(writer, some, with_walls);
      empty = writer.size() >= kPartBytes;
      if (!empty) continue;
      if (!take(writer.Take())) return false;
      begin();
    }
  }
  return empty || take(writer.Take());
}

std::optional<RecordedAnswers> DecodeAnswers(std::string_view record) {
  RecordReader reader(record);
  RecordedAnswers recorded;
  reader.Number(recorded.questions);
  while (reader.good() && !reader.Complete()) {
    PartOfRound& part = recorded.parts.emplace_back();
    reader.Number(part.block_index);
    reader.Number(part.first);
    LayOutAnswers(reader, part.answers, (part.block_index & kWithWalls) != 0);
    part.block_index &= ~kWithWalls;
  }
  if (!reader.Complete()) return std::nullopt;
  return recorded;
}

std::string EncodeRound(const RecordedRound& round) {
  return Encoded(round, [](auto& archive, auto& value) { LayOutRound(archive, value); });
}

std::optional<RecordedRound> DecodeRound(std::string_view record) {
  return Decoded<RecordedRound>(record,
                                [](auto& archive, auto& value) { LayOutRound(archive, value); });
}

std::string EncodeEnd(const SessionEnd& end) {
  RecordWriter writer;
  writer.Number(static_cast<int>(end.state));
  writer.Number(ToNumber(end.time));
  writer.Number(end.elapsed_seconds);
  writer.Bytes(std::string(FailureReasonName(end.failure.reason)));
  writer.Bytes(end.failure.message);
  writer.Number(end.rounds);
  return writer.Take();
}

std::optional<SessionEnd> DecodeEnd(std::string_view record) {
  RecordReader reader(record);
  SessionEnd end;
  int state = 0;
  std::int64_t time = 0;
  reader.Number(state);
  reader.Number(time);
  reader.Number(end.elapsed_seconds);
  std::string reason;
  reader.Bytes(reason);
  reader.Bytes(end.failure.message);
  reader.Number(end.rounds);
  end.state = static_cast<SessionState>(state);
  end.time = ToTime(time);
  const bool ended = end.state >= SessionState::kSucceeded && end.state <= SessionState::kFailed;
  const auto known = FailureReasonOf(reason);
  if (!reader.Complete() || !ended || !known) return std::nullopt;
  end.failure.reason = *known;
  return end;
}

std::uint64_t DigestOf(const core::QueryBatch& batch) {
  RecordDigest digest;
  digest.Add(batch.round);
  for (const core::QueryBlock& block : batch.blocks) {
    digest.Add(static_cast<std::uint64_t>(block.kind));
    digest.Add(block.want.tangents);
    digest.Add(block.want.sizes);
    core::QueryBlock::ForEachField([&](auto field) { digest.Add(block.*field); });
    if (block.want.clearances) digest.Add(block.face);
  }
  return digest.value();
}

std::uint64_t DigestOf(const core::Answers& answers) {
  RecordDigest digest;
  for (const core::AnswerBlock& block : answers.blocks) {
    ForEachRecorded(block.clearances.cols() > 0, [&](auto field) { digest.Add(block.*field); });
  }
  return digest.value();
}

}  // namespace stellate::server
