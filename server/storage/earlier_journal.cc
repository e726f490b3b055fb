#include "server/storage/earlier_journal.h"

#include <optional>
#include <utility>

#include "core/base/message.h"
#include "server/records/journal_format.h"
#include "server/records/record_bytes.h"

namespace stellate::server {
namespace {

using core::Message;
using core::Status;

// A record carries its seal behind it.
std::optional<std::string> Unseal(std::string_view sealed, const std::string& place) {
  if (sealed.size() < kWord) return std::nullopt;
  const std::string_view record = sealed.substr(0, sealed.size() - kWord);
  RecordDigest digest;
  digest.Add(place.data(), place.size());
  digest.Add(record.data(), record.size());
  const std::uint64_t seal = digest.value();
  if (std::memcmp(sealed.data() + record.size(), &seal, kWord) != 0) return std::nullopt;
  return std::string(record);
}

std::optional<core::Answers> DecodeWhole(std::string_view record) {
  RecordReader reader(record);
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

Status CannotWrite(JournalFile* file) {
  return {
      core::StatusCode::kFailedPrecondition,
      Message("a journal of an earlier version cannot be taken over: ", file->database().error(),
              "; it was left as it is: make room on the disk, and start again")};
}

}  // namespace

Status EarlierJournal::Open() {
  auto opened = Sqlite::Open(path_, false);
  if (!opened) return DamagedJournal(path_, opened.error().message);
  database_ = std::move(*opened);
  database_->CheckpointOnClose(false);
  if (!database_->Execute("PRAGMA locking_mode=EXCLUSIVE")) {
    return DamagedJournal(path_, database_->error());
  }
  Statement check(*database_, "PRAGMA integrity_check(1)");
  if (!check.Next()) return DamagedJournal(path_, database_->error());
  if (check.Bytes(0) != "ok") return DamagedJournal(path_, std::string(check.Bytes(0)));
  return Status::Ok();
}

Status EarlierJournal::CopyTo(JournalFile* file) {
  Statement meshes(*database_, "SELECT id, start, finish FROM meshes ORDER BY id");
  std::uint64_t rounds = 0;
  while (meshes.Next()) {
    const std::int64_t id = meshes.Number(0);
    const auto start = Unseal(meshes.Bytes(1), Message("start/", id));
    MeshRequest request;
    std::chrono::system_clock::time_point created;
    if (!start || !DecodeEarlierStart(*start, version_, &request, &created)) {
      return DamagedJournal(path_, Message("the specification of mesh ", id));
    }
    std::optional<std::string> end;
    if (!meshes.IsNull(2)) {
      end = Unseal(meshes.Bytes(2), Message("end/", id));
      const auto decoded = end ? DecodeEnd(*end) : std::nullopt;
      if (!decoded) return DamagedJournal(path_, Message("the end of mesh ", id));
      if (decoded->failure.reason == FailureReason::kRemoved) {
        Statement lost(*database_, "SELECT count(DISTINCT round) FROM rounds WHERE mesh = ?");
        if (lost.Bind(0, id).Next()) rounds += static_cast<std::uint64_t>(lost.Number(0));
        continue;
      }
    }
    std::int64_t to = 0;
    const bool put = file->Transact([&] {
      to = file->NewMesh();
      return file->Put({to, RecordKind::kStart}, EncodeStart(request, created)) &&
             (!end || file->Put({to, RecordKind::kEnd}, *end));
    });
    if (!put) return CannotWrite(file);
    Status status = CopyMesh(id, to, &rounds, file);
    if (!status.ok()) return status;
  }
  if (meshes.failed()) return DamagedJournal(path_, database_->error());
  Statement all(*database_, "SELECT count(*) FROM (SELECT DISTINCT mesh, round FROM rounds)");
  if (!all.Next() || static_cast<std::uint64_t>(all.Number(0)) != rounds) {
    return DamagedJournal(path_, "there is a gap in a mesh's rounds");
  }
  return Status::Ok();
}

Status EarlierJournal::CopyMesh(std::int64_t from, std::int64_t to, std::uint64_t* rounds,
                                JournalFile* file) {
  for (std::int64_t round = 1;; ++round, ++*rounds) {
    bool found = false;
    Status status = CopyRound(from, round, to, &found, file);
    if (!status.ok() || !found) return status;
  }
}

Status EarlierJournal::CopyRound(std::int64_t mesh, std::int64_t round, std::int64_t to,
                                 bool* found, JournalFile* file) {
  Statement rows(*database_,
                 "SELECT part, parts, questions, answers FROM rounds WHERE mesh = ? AND round = ? "
                 "ORDER BY part");
  rows.Bind(0, mesh).Bind(1, round);
  Status damaged = DamagedJournal(path_, Message("round ", round, " of mesh ", mesh));
  std::string whole;
  std::int64_t due = 0, parts = 0;
  RecordedRound recorded;
  for (; rows.Next(); ++due) {
    *found = true;
    parts = rows.Number(1);
    recorded.questions = static_cast<std::uint64_t>(rows.Number(2));
    const auto part = Unseal(rows.Bytes(3), Message("round/", mesh, "/", round, "/", rows.Number(0),
                                                    "/", parts, "/", recorded.questions));
    if (!part || rows.Number(0) != due) return damaged;
    whole += *part;
  }
  if (rows.failed() || due != parts) return damaged;
  if (!*found) return Status::Ok();
  const auto answers = DecodeWhole(whole);
  if (!answers) return damaged;
  std::vector<Eigen::Index> sizes;
  for (const core::AnswerBlock& block : answers->blocks) sizes.push_back(block.points.cols());
  recorded.answers = DigestOf(*answers);
  const bool put = file->Transact([&] {
    const auto put_part = [&](const std::string& part) {
      const auto number = static_cast<std::int64_t>(recorded.parts++);
      return file->Put({to, RecordKind::kAnswers, round, number}, part);
    };
    return EncodeAnswers(*answers, Missing({}, sizes), recorded.questions, put_part) &&
           file->Put({to, RecordKind::kRound, round}, EncodeRound(recorded));
  });
  return put ? Status::Ok() : CannotWrite(file);
}

Status EarlierJournal::Close() {
  database_->CheckpointOnClose(true);
  if (!database_->Execute("PRAGMA wal_checkpoint(TRUNCATE)")) {
    return {core::StatusCode::kFailedPrecondition,
            Message("cannot write ", path_, ": ", database_->error())};
  }
  database_.reset();
  return Status::Ok();
}

}  // namespace stellate::server
