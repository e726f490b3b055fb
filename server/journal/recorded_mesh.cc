#include "server/journal/recorded_mesh.h"

#include <algorithm>
#include <utility>

#include "core/base/message.h"

namespace stellate::server {
namespace {

using core::Message;
using Eigen::Index;
using Found = Records::Found;

constexpr std::int64_t kNever = -1;                          // no epoch of any mesh
constexpr std::size_t kHistoryBytes = std::size_t{1} << 20;  // of a record

std::vector<Index> SizesOf(const core::QueryBatch& batch) {
  std::vector<Index> sizes;
  for (const core::QueryBlock& block : batch.blocks) sizes.push_back(block.size());
  return sizes;
}

MeshFailure Unreadable(const std::string& what) {
  return {FailureReason::kJournalFailed, Message("the record of ", what, " cannot be read back")};
}

}  // namespace

RecordedMesh::RecordedMesh(std::shared_ptr<SharedJournal> journal, std::uint64_t owner_limit,
                           std::int64_t id, const StoredMesh& stored, const MeshRequest& request)
    : journal_(std::move(journal)),
      owner_limit_(owner_limit),
      id_(id),
      epoch_(journal_->EpochOf(id)),
      counted_(stored.bytes),
      has_history_(stored.has_history),
      rounds_(stored.rounds),
      has_answers_(stored.has_answers) {
  SetShape(request);
  journal_->CountFor(owner_, static_cast<std::int64_t>(stored.bytes));
}

RecordedMesh::~RecordedMesh() { journal_->CountFor(owner_, -static_cast<std::int64_t>(counted_)); }

bool RecordedMesh::IsHeld() const { return id_ == 0 || journal_->EpochOf(id_) == epoch_; }

// What is deleted may have been removed already.
bool RecordedMesh::IsElsewhere() const { return !forgotten_ && !IsHeld(); }

void RecordedMesh::SetShape(const MeshRequest& request) {
  owner_ = request.owner;
  shape_.dimension = request.spec.dimension;
  shape_.ambient_dimension = request.spec.ambient_dimension;
  shape_.walls = request.spec.walls;
  shape_.simplex_dimension = request.spec.simplex_dimension();
  shape_.labels = std::max(request.spec.labels_per_simplex(), 1);
}

// Writes of about `bytes`, unless the mesh is not wanted any more.
std::optional<MeshFailure> RecordedMesh::Do(const char* what, FairMutex::Place place,
                                            std::uint64_t bytes,
                                            const std::function<bool(Records*)>& action) {
  if (forgotten_) return std::nullopt;
  if (auto refused = RefuseShare(bytes)) return refused;
  return journal_->Do(what, place, [&](Records* records) {
    // Under the records' lock: a removal comes before, and is seen here, or after, and sees the id.
    if (forgotten_) return true;
    if (!IsHeld()) return false;
    const bool done = action(records);
    Recount(*records);
    return done;
  });
}

std::optional<MeshFailure> RecordedMesh::RefuseShare(std::uint64_t bytes) const {
  if (owner_limit_ == 0 || owner_.empty() || bytes == 0) return std::nullopt;
  const std::uint64_t owned = journal_->OwnerBytes(owner_);
  if (owned + bytes <= owner_limit_) return std::nullopt;
  return MeshFailure{FailureReason::kJournalFull,
                     Message("the records of your meshes have ", owned, " bytes, and ", bytes,
                             " more are beyond the ", owner_limit_,
                             " that the server allows each owner: delete meshes that are no longer "
                             "needed, then mesh again")};
}

void RecordedMesh::Recount(const Records& records) {
  const std::uint64_t bytes = records.BytesOf(id_);
  journal_->CountFor(owner_, static_cast<std::int64_t>(bytes - counted_));
  counted_ = bytes;
}

std::optional<MeshFailure> RecordedMesh::WriteStart(
    const MeshRequest& request, std::chrono::system_clock::time_point create_time) {
  SetShape(request);
  const std::string record = EncodeStart(request, create_time);
  return Do("the mesh", FairMutex::Place::kLast, record.size(), [&](Records* records) {
    std::int64_t id = 0;
    const bool written = records->Transact([&] {
      id = records->NewMesh();
      return records->Put({id, RecordKind::kStart}, record);
    });
    if (!written) {
      const auto refusal = records->trouble().refusal;
      is_beyond_limit_ = refusal == Records::Trouble::Refusal::kTooMany;
      if (refusal == Records::Trouble::Refusal::kTaken) epoch_ = kNever, id_ = id;
      return false;
    }
    epoch_ = records->EpochOf(id);
    id_ = id;
    return true;
  });
}

SessionJournal::Known RecordedMesh::BeginRound(const core::QueryBatch& batch) {
  const std::uint64_t questions = DigestOf(batch);
  {
    const std::lock_guard lock(mutex_);
    round_ = static_cast<std::int64_t>(batch.round);
    questions_ = questions;
    sizes_ = SizesOf(batch);
    pending_.clear();
    answers_.reset();
  }
  parts_.written.clear();
  parts_.next = 0;
  if (batch.round <= rounds_) return ReadRound(batch);
  if (std::exchange(has_answers_, false) && batch.round == rounds_ + 1) {
    return ReadPartOfRound(batch);
  }
  return {};
}

// False: it cannot be read. A part that is not there is no fault here, nor are answers to other
// questions, of which nothing is known.
bool RecordedMesh::ReadAnswers(Records* records, const core::QueryBatch& batch, std::int64_t part,
                               RecordedAnswers* answers, Found* found) const {
  const auto round = static_cast<std::int64_t>(batch.round);
  std::string record;
  *found = records->Read({id_, RecordKind::kAnswers, round, part}, &record);
  if (*found != Found::kYes) return *found == Found::kNo;
  auto decoded = DecodeAnswers(record);
  if (!decoded) return false;
  *answers = std::move(*decoded);
  return answers->questions != questions_ ||
         std::all_of(answers->parts.begin(), answers->parts.end(),
                     [&](const PartOfRound& one) { return Fits(batch, one); });
}

bool RecordedMesh::Fits(const core::QueryBatch& batch, const PartOfRound& part) const {
  if (part.block_index >= batch.blocks.size()) return false;
  const core::QueryBlock& block = batch.blocks[part.block_index];
  const Index count = part.answers.size();
  return part.first >= 0 && count <= block.size() && part.first <= block.size() - count &&
         part.answers.Fits(core::AnswerBlock::Shape(shape_.dimension, shape_.walls, block, 1));
}

SessionJournal::Known RecordedMesh::ReadRound(const core::QueryBatch& batch) {
  const auto number = static_cast<std::int64_t>(batch.round);
  Known known{{}, {}, Unreadable(Message("round ", batch.round))};
  journal_->Do("nothing", FairMutex::Place::kLast, [&](Records* records) {
    std::string record;
    if (records->Read({id_, RecordKind::kRound, number}, &record) != Found::kYes) return true;
    const auto round = DecodeRound(record);
    if (!round) return true;
    if (round->questions != questions_) {
      known.failure = MeshFailure{FailureReason::kReplayMismatch,
                                  Message("in round ", batch.round,
                                          " this server asks other questions than the server that "
                                          "recorded the answers: mesh again")};
      return true;
    }
    core::Answers answers = EmptyAnswers(shape_.dimension, batch, shape_.walls);
    for (std::uint64_t part = 0; part < round->parts; ++part) {
      RecordedAnswers some;
      Found found;
      if (!ReadAnswers(records, batch, static_cast<std::int64_t>(part), &some, &found)) return true;
      if (found != Found::kYes || some.questions != questions_) return true;
      for (const PartOfRound& one : some.parts) server::PutAnswers(one, &answers);
    }
    if (DigestOf(answers) != round->answers) return true;
    known.answers = std::move(answers);
    known.failure.reset();
    return true;
  });
  return known;
}

SessionJournal::Known RecordedMesh::ReadPartOfRound(const core::QueryBatch& batch) {
  const auto number = static_cast<std::int64_t>(batch.round);
  Known known;
  bool others = false;  // another version of the mesher asked them
  auto failure =
      journal_->Do("the answers of a round", FairMutex::Place::kLast, [&](Records* records) {
        Found found = Found::kYes;
        for (std::int64_t part = 0; found == Found::kYes; ++part) {
          RecordedAnswers some;
          if (!ReadAnswers(records, batch, part, &some, &found)) {
            known.failure = Unreadable(Message("some of round ", batch.round));
            return true;
          }
          if (found != Found::kYes) break;
          others = others || some.questions != questions_;
          parts_.next = part + 1;
          for (PartOfRound& one : some.parts) {
            parts_.written.push_back(
                {one.block_index, one.first, one.first + one.answers.points.cols()});
            known.parts.push_back(std::move(one));
          }
        }
        if (!others) return true;
        parts_.written.clear();
        known = {};
        return records->Transact([&] {
          while (parts_.next > 0) {
            if (!records->Remove({id_, RecordKind::kAnswers, number, --parts_.next})) return false;
          }
          return true;
        });
      });
  if (failure) known.failure = std::move(failure);
  std::sort(known.parts.begin(), known.parts.end(), [](const auto& a, const auto& b) {
    return std::pair(a.block_index, a.first) < std::pair(b.block_index, b.first);
  });
  return known;
}

void RecordedMesh::TakeAnswers(const std::shared_ptr<const Round>& round, std::size_t block,
                               Index first, Index count) {
  {
    const std::lock_guard lock(mutex_);
    if (round_ == 0 || round->batch->round != static_cast<std::uint64_t>(round_)) return;
    answers_ = round;
    pending_.push_back({block, first, first + count});
  }
  journal_->WriteAnswersLater(shared_from_this());
}

bool RecordedMesh::HasAnswers() const {
  const std::lock_guard lock(mutex_);
  return !pending_.empty() && !forgotten_ && IsHeld();
}

bool RecordedMesh::WriteAnswers(Records* records) {
  std::shared_ptr<const Round> round;
  draft_.next = parts_.next;
  {
    const std::lock_guard lock(mutex_);
    draft_.written = Merged(std::exchange(pending_, {}));
    round = answers_;
  }
  // An owner who has used up his share hears of it at the end of the round.
  if (draft_.written.empty() || RefuseShare(1)) return true;
  return PutAnswers(records, round->answers, draft_.written, &draft_.next);
}

void RecordedMesh::AnswersWritten(bool written) {
  if (written && draft_.next > parts_.next) {
    parts_.next = draft_.next;
    parts_.written.insert(parts_.written.end(), draft_.written.begin(), draft_.written.end());
  }
  draft_.written.clear();
}

bool RecordedMesh::PutAnswers(Records* records, const core::Answers& answers,
                              const std::vector<AnswerRange>& ranges,
                              std::int64_t* next_part) const {
  return EncodeAnswers(answers, ranges, questions_, [&](const std::string& record) {
    return records->Put({id_, RecordKind::kAnswers, round_, (*next_part)++}, record);
  });
}

std::optional<MeshFailure> RecordedMesh::WriteRound(const core::QueryBatch& batch,
                                                    const core::Answers& answers,
                                                    const Standing& standing) {
  {
    const std::lock_guard lock(mutex_);  // the rest is written here
    pending_.clear();
    answers_.reset();
  }
  RecordedRound round{questions_, DigestOf(answers), 0, standing};
  auto failure = Do("the answers of a round", FairMutex::Place::kLast, 1, [&](Records* records) {
    return records->Transact([&] {
      std::int64_t parts = parts_.next;
      if (!PutAnswers(records, answers, Missing(Merged(parts_.written), sizes_), &parts))
        return false;
      round.parts = static_cast<std::uint64_t>(parts);
      return records->Put({id_, RecordKind::kRound, round_}, EncodeRound(round));
    });
  });
  if (!failure) rounds_ = batch.round;
  return failure;
}

// It is short, and others wait for it.
std::optional<MeshFailure> RecordedMesh::WriteEnd(const SessionEnd& end) {
  return Do("the end of the mesh", FairMutex::Place::kFirst, 0, [&](Records* records) {
    return id_ == 0 || records->Transact([&] {
      return records->Put({id_, RecordKind::kEnd}, EncodeEnd(end));
    });
  });
}

std::optional<MeshFailure> RecordedMesh::WriteResult(const SessionResult& result,
                                                     const MeshHistory& history) {
  if (id_ == 0) return std::nullopt;
  std::optional<MeshFailure> failure;
  // Of a server that was killed as it wrote.
  for (bool done = !has_history_; !done && !failure;) {
    failure = Do("the finished mesh", FairMutex::Place::kLast, 0, [&](Records* records) {
      return records->RemoveSome(id_, Records::Kinds::kHistory, &done);
    });
    done = done || forgotten_;
  }
  has_history_ = true;
  std::string record;
  std::int64_t parts = 0;
  const auto put = [&] {
    failure =
        Do("the finished mesh", FairMutex::Place::kLast, record.size(), [&](Records* records) {
          return records->Transact([&] {
            return records->Put({id_, RecordKind::kHistoryPart, 0, parts}, record);
          });
        });
    ++parts;
    record.clear();
    return !failure;
  };
  const auto add = [&](const void* data, std::size_t bytes) {
    for (const char* at = static_cast<const char*>(data); bytes > 0;) {
      const std::size_t take = std::min(bytes, kHistoryBytes - record.size());
      record.append(at, take);
      at += take;
      bytes -= take;
      if (record.size() == kHistoryBytes && !put()) return false;
    }
    return true;
  };
  if (!failure && history.Write(add) && (record.empty() || put())) {
    failure = Do("the finished mesh", FairMutex::Place::kFirst, 0, [&](Records* records) {
      return records->Transact([&] {
        return records->Put({id_, RecordKind::kResult},
                            EncodeResult(result, static_cast<std::uint64_t>(parts)));
      });
    });
  }
  if (!failure) RemoveRounds();
  return failure;
}

core::Expected<std::unique_ptr<MeshHistory>> RecordedMesh::ReadHistory() {
  std::string record;
  std::size_t used = 0;
  std::int64_t part = 0;
  const auto read = [&](void* data, std::size_t bytes) {
    for (char* at = static_cast<char*>(data); bytes > 0;) {
      if (used == record.size()) {
        Found found = Found::kNo;
        journal_->Do("nothing", FairMutex::Place::kLast, [&](Records* records) {
          found = records->Read({id_, RecordKind::kHistoryPart, 0, part++}, &record);
          return true;
        });
        used = 0;
        if (found != Found::kYes) return false;
      }
      const std::size_t take = record.copy(at, bytes, used);
      at += take;
      used += take;
      bytes -= take;
    }
    return true;
  };
  return MeshHistory::Read(shape_.simplex_dimension, shape_.ambient_dimension, read, shape_.labels);
}

void RecordedMesh::RemoveRounds() { journal_->RemoveLater(shared_from_this()); }

void RecordedMesh::Forget() {
  if (!forgotten_.exchange(true)) journal_->RemoveLater(shared_from_this());
}

bool RecordedMesh::RemoveSome(Records* records, bool* done) {
  *done = id_ == 0 || !IsHeld();  // or its next server removes it
  if (*done) return true;
  const auto kinds = forgotten_ ? Records::Kinds::kAll : Records::Kinds::kRounds;
  const bool removed = records->RemoveSome(id_, kinds, done);
  Recount(*records);
  return removed;
}

}  // namespace stellate::server
