// The records inside a journal, with their seals taken off: refused, or read as what would be
// written again. An input is one byte that chooses the kind, and the record.

#include "server/journal_format.h"
#include "tests/fuzz/target.h"
#include "tests/server/sphere.h"

namespace stellate::fuzz {

std::vector<std::string> Seeds() {
  server::SessionOptions options;
  options.name = "meshes/00000000000000000000000000000000";
  options.owner = "someone";
  options.label = "something";
  options.spec = server::testing::SphereSpec(0.3);
  std::vector<std::string> seeds;
  seeds.push_back('\0' + server::EncodeStart(options, {}));
  options.spec.bounding_box.reset();
  options.spec.seeds = Eigen::MatrixXd::Ones(3, 2);
  options.spec.criteria.judging = core::Judging::kFlats;
  options.spec.criteria.sliver_bound = 0.1;
  seeds.push_back('\0' + server::EncodeStart(options, {}));
  core::Answers answers;
  answers.blocks.push_back(
      {Eigen::MatrixXd::Ones(3, 4), {1, 0, 1, 1}, Eigen::MatrixXd::Ones(6, 4), {}});
  answers.blocks.push_back({Eigen::MatrixXd::Ones(3, 1), {}, {}, Eigen::VectorXd::Ones(1)});
  seeds.push_back('\1' + server::EncodeAnswers(answers));
  seeds.push_back('\1' + server::EncodeAnswers({}));
  server::SessionEnd end;
  end.state = server::SessionState::kFailed;
  end.failure = {"NO_WORKER", "nobody came"};
  seeds.push_back('\2' + server::EncodeEnd(end));
  return seeds;
}

}  // namespace stellate::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace stellate;
  using fuzz::Require;
  fuzz::Script script(data, size);
  const int kind = script.Byte() % 3;
  const std::string record = script.Rest();
  if (kind == 0) {
    server::SessionOptions options;
    std::chrono::system_clock::time_point create_time;
    if (server::DecodeStart(record, &options, &create_time)) {
      const std::string once = server::EncodeStart(options, create_time);
      server::SessionOptions again;
      std::chrono::system_clock::time_point same;
      Require(server::DecodeStart(once, &again, &same), "a written start can be read");
      Require(server::EncodeStart(again, same) == once, "and is the same");
    }
  } else if (kind == 1) {
    if (const auto answers = server::DecodeAnswers(record)) {
      const std::string once = server::EncodeAnswers(*answers);
      const auto again = server::DecodeAnswers(once);
      Require(again.has_value(), "written answers can be read");
      Require(server::EncodeAnswers(*again) == once, "and are the same");
    }
  } else if (const auto end = server::DecodeEnd(record)) {
    const std::string once = server::EncodeEnd(*end);
    const auto again = server::DecodeEnd(once);
    Require(again.has_value(), "a written end can be read");
    Require(server::EncodeEnd(*again) == once, "and is the same");
  }
  return 0;
}
