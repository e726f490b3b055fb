// A MeshSpec off the wire: refused with words, or a specification that the core takes, that comes
// back from the wire and from the journal as it was, and whose first questions are in order.

#include <google/protobuf/stubs/logging.h>

#include "core/mesher.h"
#include "server/convert/arrays.h"
#include "server/convert/spec.h"
#include "server/records/journal_format.h"
#include "tests/fuzz/target.h"
#include "tests/server/support/sphere.h"

namespace stellate::fuzz {
namespace {

using server::Config;
using server::FromProto;
using server::ToProto;

// Larger first batches say nothing more, and cost a fuzzer its speed.
constexpr std::uint64_t kMostSeedCoordinates = 1 << 16;

std::string RecordOf(const core::Specification& spec) {
  server::MeshRequest request;
  request.name = "meshes/fuzz";
  request.spec = spec;
  return server::EncodeStart(request, {});
}

void CheckRecord(const core::Specification& spec) {
  const std::string record = RecordOf(spec);
  server::MeshRequest request;
  std::chrono::system_clock::time_point create_time;
  Require(server::DecodeStart(record, &request, &create_time), "a record can be read back");
  Require(RecordOf(request.spec) == record, "the journal gives the specification back");
}

void CheckWire(const core::Specification& spec, const Config& config) {
  if (spec.seeds.size() > 0 || !spec.bounding_box) return;  // seeds are not sent back
  v1::MeshSpec wire;
  ToProto(spec, &wire);
  const auto again = FromProto(wire, config);
  Require(again.has_value(), "what the server sends back it would take again");
  Require(RecordOf(again->spec) == RecordOf(spec), "the wire gives the specification back");
}

void CheckFirstQuestions(core::Specification spec) {
  const auto d = static_cast<std::uint64_t>(spec.ambient_dimension);
  const auto seeds = static_cast<std::uint64_t>(spec.seeds.cols() + spec.box_seeds);
  if (d * seeds > kMostSeedCoordinates) return;
  const Eigen::Index rows = spec.ambient_dimension;
  const auto mesher = core::Mesher::Create(std::move(spec), {.threads = 1});
  Require(mesher.has_value(), "a valid specification makes a mesher");
  const auto batch = (*mesher)->NextBatch();
  Require(batch != nullptr && batch->size() > 0, "a mesher begins with a question");
  for (const core::QueryBlock& block : batch->blocks) {
    Require(block.points.rows() == rows, "questions are points of R^d");
    Require(block.points.allFinite(), "questions are finite");
  }
}

}  // namespace

std::vector<std::string> Seeds() {
  std::vector<std::string> seeds;
  v1::MeshSpec spec;
  ToProto(server::testing::SphereSpec(0.3), &spec);
  seeds.push_back(spec.SerializeAsString());
  spec.clear_limits();
  spec.clear_criteria();
  seeds.push_back(spec.SerializeAsString());
  spec.clear_bounding_box();
  const double points[] = {1, 0, 0, 0, -1, 0};
  ToProto(points, {2, 3}, spec.mutable_seeds());
  spec.mutable_criteria()->set_speculative(true);
  spec.mutable_criteria()->set_common_centre(true);
  spec.mutable_criteria()->set_candidates(7);
  spec.mutable_criteria()->set_advance_step(1);
  spec.mutable_criteria()->set_flat_alternations(2);
  spec.mutable_limits()->set_worker_wait_seconds(5);
  spec.mutable_limits()->set_answer_seconds(5);
  spec.set_label("a label");
  seeds.push_back(spec.SerializeAsString());
  spec.mutable_seeds()->set_shape(0, 0xffffffffu);  // far more than is there
  seeds.push_back(spec.SerializeAsString());
  spec.set_ambient_dimension(4096);
  spec.set_box_seeds(100'000);
  seeds.push_back(spec.SerializeAsString());
  return seeds;
}

}  // namespace stellate::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace stellate;
  using fuzz::Require;
  // It would tell of every text that is none.
  static const auto silent = google::protobuf::SetLogHandler(nullptr);
  static_cast<void>(silent);
  static const server::Config config;
  v1::MeshSpec wire;
  if (!wire.ParseFromArray(data, static_cast<int>(size))) return 0;
  const auto request = server::FromProto(wire, config);
  if (!request) {
    const core::Status& status = request.error();
    Require(status.code == core::StatusCode::kInvalidArgument ||
                status.code == core::StatusCode::kLimitExceeded,
            "a refusal is the client's fault or a limit");
    Require(!status.message.empty(), "a refusal has words");
    return 0;
  }
  Require(core::Validate(request->spec).ok(), "the core takes what the server let through");
  Require(request->timeouts.worker_wait.count() > 0 && request->timeouts.answer_limit.count() > 0,
          "waits are above zero");
  fuzz::CheckRecord(request->spec);
  fuzz::CheckWire(request->spec, config);
  fuzz::CheckFirstQuestions(request->spec);
  return 0;
}
