// The records inside a journal, with their seals taken off: refused, or read as what would be
// written again. An input is one byte that chooses the kind, and the record.

#include "server/records/journal_format.h"
#include "tests/fuzz/target.h"
#include "tests/server/support/sphere.h"

namespace stellate::fuzz {
namespace {

// All answers of a round, in records as a journal holds them.
std::vector<std::string> Encoded(const core::Answers& answers, std::uint64_t questions) {
  std::vector<server::AnswerRange> ranges;
  for (std::size_t b = 0; b < answers.blocks.size(); ++b)
    ranges.push_back({b, 0, answers.blocks[b].points.cols()});
  std::vector<std::string> records;
  server::EncodeAnswers(answers, ranges, questions, [&](const std::string& record) {
    records.push_back(record);
    return true;
  });
  return records;
}

// Written and read again, one part as the first of its round.
std::vector<std::string> EncodedPart(const server::PartOfRound& part, std::uint64_t questions) {
  core::Answers answers;
  answers.blocks.push_back(part.answers);
  return Encoded(answers, questions);
}

void CheckAnswers(const server::RecordedAnswers& recorded) {
  for (const server::PartOfRound& part : recorded.parts) {
    for (const std::string& once : EncodedPart(part, recorded.questions)) {
      const auto again = server::DecodeAnswers(once);
      Require(again.has_value() && again->questions == recorded.questions,
              "written answers can be read");
      for (const server::PartOfRound& same : again->parts) {
        const auto twice = EncodedPart(same, again->questions);
        Require(
            again->parts.size() > 1 || (twice.size() == 1 && twice.front().size() == once.size()),
            "and are as long");
      }
    }
  }
}

}  // namespace

std::vector<std::string> Seeds() {
  server::MeshRequest request;
  request.name = "meshes/00000000000000000000000000000000";
  request.owner = "someone";
  request.label = "something";
  request.spec = server::testing::SphereSpec(0.3);
  std::vector<std::string> seeds;
  seeds.push_back('\0' + server::EncodeStart(request, {}));
  request.spec.bounding_box.reset();
  request.spec.seeds = Eigen::MatrixXd::Ones(3, 2);
  request.spec.criteria.centre_rule = core::CentreRule::kTangentSpace;
  request.spec.criteria.sliver_bound = 0.1;
  seeds.push_back('\0' + server::EncodeStart(request, {}));
  core::Answers answers;
  answers.blocks.push_back(
      {Eigen::MatrixXd::Ones(3, 4), {1, 0, 1, 1}, Eigen::MatrixXd::Ones(6, 4), {}, {}, {}});
  answers.blocks.push_back({Eigen::MatrixXd::Ones(3, 1), {}, {}, Eigen::VectorXd::Ones(1), {}, {}});
  for (const std::string& record : Encoded(answers, 7)) seeds.push_back('\1' + record);
  server::SessionEnd end;
  end.state = server::SessionState::kFailed;
  end.failure = {server::FailureReason::kNoWorker, "nobody came"};
  seeds.push_back('\2' + server::EncodeEnd(end));
  seeds.push_back('\3' + server::EncodeRound({1, 2, 3, 4}));
  return seeds;
}

}  // namespace stellate::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace stellate;
  using fuzz::Require;
  fuzz::Script script(data, size);
  const int kind = script.Byte() % 4;
  const std::string record = script.Rest();
  if (kind == 0) {
    server::MeshRequest request;
    std::chrono::system_clock::time_point create_time;
    if (server::DecodeStart(record, &request, &create_time)) {
      const std::string once = server::EncodeStart(request, create_time);
      server::MeshRequest again;
      std::chrono::system_clock::time_point same;
      Require(server::DecodeStart(once, &again, &same), "a written start can be read");
      Require(server::EncodeStart(again, same) == once, "and is the same");
    }
  } else if (kind == 1) {
    if (const auto answers = server::DecodeAnswers(record)) fuzz::CheckAnswers(*answers);
  } else if (kind == 3) {
    if (const auto round = server::DecodeRound(record))
      Require(server::EncodeRound(*round) == record, "a round is read as it was written");
  } else if (const auto end = server::DecodeEnd(record)) {
    const std::string once = server::EncodeEnd(*end);
    const auto again = server::DecodeEnd(once);
    Require(again.has_value(), "a written end can be read");
    Require(server::EncodeEnd(*again) == once, "and is the same");
  }
  return 0;
}
