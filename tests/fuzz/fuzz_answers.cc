// An AnswerChunk off the wire, to a chunk of any shape: refused with words, or arrays of just the
// size that was asked for. Values are then checked as the server checks them.
//
// An input is five bytes that choose the chunk, and the message.

#include <google/protobuf/stubs/logging.h>

#include "core/batch.h"
#include "server/convert/arrays.h"
#include "server/convert/oracle.h"
#include "tests/fuzz/target.h"

namespace stellate::fuzz {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;

struct Asked {
  core::Specification spec;
  server::Chunk chunk;
};

// Queries first, first + 1, ... of a block of points and coordinate planes.
Asked MakeChunk(Script* script) {
  Asked asked;
  core::Specification& spec = asked.spec;
  spec.dimension = 1 + script->Byte() % 3;
  spec.ambient_dimension = spec.dimension + 1 + script->Byte() % 4;
  spec.epsilon = 0.1;
  const Index k = spec.dimension, d = spec.ambient_dimension;
  const Index first = script->Byte() % 4, count = 1 + script->Byte() % 8;
  const std::uint8_t kind = script->Byte();
  core::QueryBlock block;
  block.points = MatrixXd::Constant(d, first + count, 0.5);
  block.want.tangents = (kind & 1) != 0;
  block.want.sizes = (kind & 4) != 0;
  if ((kind & 2) != 0) {
    block.kind = core::QueryKind::kIntersectFlat;
    MatrixXd basis = MatrixXd::Zero(d * k, 1);
    for (Index a = 0; a < k; ++a) basis(a * k + a) = 1;
    block.bases = basis.replicate(1, first + count);
    block.radii = Eigen::VectorXd::Constant(first + count, 2.0);
  }
  auto round = std::make_shared<server::Round>();
  round->batch = std::make_shared<core::QueryBatch>(core::QueryBatch{0, {std::move(block)}});
  asked.chunk = {1, std::move(round), 0, first, count};
  return asked;
}

}  // namespace

std::vector<std::string> Seeds() {
  std::vector<std::string> seeds;
  for (int choice = 0; choice < 96; ++choice) {
    std::string head{static_cast<char>(choice % 3), static_cast<char>(choice / 3 % 4), 1, 3,
                     static_cast<char>(choice / 12)};
    Script script(reinterpret_cast<const std::uint8_t*>(head.data()), head.size());
    const Asked asked = MakeChunk(&script);
    const core::QueryBlock& block = asked.chunk.block();
    const auto n = static_cast<std::size_t>(asked.chunk.count);
    const auto d = static_cast<std::size_t>(asked.spec.ambient_dimension);
    const auto k = static_cast<std::size_t>(asked.spec.dimension);
    v1::AnswerChunk answers;
    answers.set_lease(1);
    server::ToProto(block.points.data(), {n, d}, answers.mutable_points());
    if (choice % 2 == 0) answers.set_found(std::string(n, 1));
    MatrixXd tangents = MatrixXd::Zero(static_cast<Index>(d * k), asked.chunk.count);
    for (std::size_t a = 0; a < k; ++a) tangents.row(static_cast<Index>(a * k + a)).setOnes();
    if (block.want.tangents) {
      server::ToProto(tangents.data(), {n, d, k}, answers.mutable_tangents());
    }
    if (block.want.sizes) {
      const Eigen::VectorXd sizes = Eigen::VectorXd::Ones(asked.chunk.count);
      server::ToProto(sizes.data(), {n}, answers.mutable_sizes());
    }
    seeds.push_back(head + answers.SerializeAsString());
    answers.mutable_points()->set_shape(0, 0xffffffffu);
    seeds.push_back(head + answers.SerializeAsString());
  }
  return seeds;
}

}  // namespace stellate::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace stellate;
  using fuzz::Require;
  // It would tell of every text that is none.
  static const auto silent = google::protobuf::SetLogHandler(nullptr);
  static_cast<void>(silent);
  fuzz::Script script(data, size);
  const fuzz::Asked asked = fuzz::MakeChunk(&script);
  v1::AnswerChunk answers;
  if (!answers.ParseFromString(script.Rest())) return 0;
  const auto block = server::FromProto(answers, asked.chunk, asked.spec);
  if (!block) {
    Require(block.error().code == core::StatusCode::kOracleShape, "only a shape can be refused");
    Require(!block.error().message.empty(), "a refusal has words");
    return 0;
  }
  const Eigen::Index n = asked.chunk.count, d = asked.spec.ambient_dimension;
  Require(block->points.rows() == d && block->points.cols() == n, "one point for each query");
  Require(block->found.empty() || block->found.size() == static_cast<std::size_t>(n),
          "one flag for each query, or none");
  Require(block->tangents.size() == 0 ||
              (block->tangents.rows() == d * asked.spec.dimension && block->tangents.cols() == n),
          "one basis for each query, or none");
  Require(block->sizes.size() == 0 || block->sizes.size() == n, "one size for each, or none");
  const core::Status status =
      core::CheckAnswers(asked.spec, asked.chunk.block(), asked.chunk.first, *block);
  if (!status.ok()) {
    Require(!status.message.empty(), "a refusal has words");
    return 0;
  }
  for (Eigen::Index j = 0; j < n; ++j) {
    const bool found = block->found.empty() || block->found[static_cast<std::size_t>(j)] != 0;
    Require(!found || block->points.col(j).allFinite(), "points that were taken are finite");
    Require(!found || block->sizes.size() == 0 || block->sizes[j] > 0, "sizes are positive");
  }
  return 0;
}
