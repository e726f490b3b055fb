#include "server/convert/oracle.h"

#include <algorithm>

#include "core/base/message.h"
#include "server/convert/arrays.h"

namespace stellate::server {
namespace {

using core::StatusCode;
using Eigen::Index;

// What answers of a manifold with boundary say of its walls.
core::Status WallsFromProto(const v1::AnswerChunk& answers, const Chunk& chunk,
                            const core::Specification& spec, core::AnswerBlock* block) {
  const auto n = static_cast<std::uint64_t>(chunk.count);
  const auto d = static_cast<std::uint64_t>(spec.ambient_dimension);
  const auto walls = static_cast<std::uint64_t>(spec.walls);
  const auto on = static_cast<std::uint64_t>(core::CountWalls(chunk.block().face));
  core::Status status = core::Status::Ok();
  if (answers.has_clearances()) {
    status = CheckArray(answers.clearances(), {n, walls}, "answers.clearances",
                        StatusCode::kOracleShape);
    if (!status.ok()) return status;
    block->clearances =
        MatrixFromProto(answers.clearances(), static_cast<Index>(walls), chunk.count);
  }
  if (on == 0 || !answers.has_conormals()) return status;
  status =
      CheckArray(answers.conormals(), {n, on, d}, "answers.conormals", StatusCode::kOracleShape);
  if (status.ok())
    block->conormals =
        MatrixFromProto(answers.conormals(), static_cast<Index>(on * d), chunk.count);
  return status;
}

}  // namespace

void ToProto(const core::Specification& spec, v1::Welcome* welcome) {
  welcome->set_dimension(spec.dimension);
  welcome->set_ambient_dimension(spec.ambient_dimension);
  welcome->mutable_oracle()->set_intersect_flat(spec.oracle.intersect_flat);
  welcome->mutable_oracle()->set_tangent_basis(spec.oracle.tangent_basis);
  welcome->mutable_oracle()->set_local_size(spec.oracle.local_size);
  welcome->mutable_oracle()->set_conormals(spec.oracle.conormals);
  welcome->set_walls(static_cast<std::uint32_t>(spec.walls));
}

void ToProto(const Chunk& chunk, const core::Specification& spec, v1::QueryChunk* out) {
  const auto n = static_cast<std::size_t>(chunk.count);
  const auto d = static_cast<std::size_t>(spec.ambient_dimension);
  const auto k = static_cast<std::size_t>(spec.dimension);
  const core::QueryBlock& block = chunk.block();
  out->set_lease(chunk.lease);
  out->set_want_tangents(block.want.tangents);
  out->set_want_sizes(block.want.sizes);
  out->set_want_clearances(block.want.clearances);
  core::ForEachWall(block.face, [&](int wall) { out->add_face(static_cast<std::uint32_t>(wall)); });
  ToProto(block.points.col(chunk.first).data(), {n, d}, out->mutable_points());
  if (block.kind == core::QueryKind::kClosestPoint) {
    out->set_kind(v1::QUERY_KIND_CLOSEST_POINT);
    return;
  }
  out->set_kind(v1::QUERY_KIND_INTERSECT_FLAT);
  ToProto(block.bases.col(chunk.first).data(), {n, d, k}, out->mutable_bases());
  ToProto(block.radii.data() + chunk.first, {n}, out->mutable_radii());
}

Allowed<core::AnswerBlock> FromProto(const v1::AnswerChunk& answers, const Chunk& chunk,
                                     const core::Specification& spec) {
  const auto n = static_cast<std::uint64_t>(chunk.count);
  const auto d = static_cast<std::uint64_t>(spec.ambient_dimension);
  const auto k = static_cast<std::uint64_t>(spec.dimension);
  const auto refuse = [&](core::Status why, std::optional<std::int64_t> row = std::nullopt) {
    return tl::unexpected(Refused(AnswerPlace{chunk.lease, row}, std::move(why)));
  };
  core::AnswerBlock block;
  core::Status status =
      CheckArray(answers.points(), {n, d}, "answers.points", StatusCode::kOracleShape);
  if (!status.ok()) return refuse(std::move(status));
  block.points = MatrixFromProto(answers.points(), static_cast<Index>(d), chunk.count);

  const std::string& found = answers.found();
  if (!found.empty()) {
    if (found.size() != n) {
      return refuse({StatusCode::kOracleShape,
                     core::Message("answers.found has ", found.size(), " bytes but ", n,
                                   " queries were asked: send one byte each, or none"),
                     "answers.found"});
    }
    const auto bad =
        std::find_if(found.begin(), found.end(), [](char c) { return c != 0 && c != 1; });
    if (bad != found.end()) {
      const auto row = bad - found.begin();
      return refuse({StatusCode::kOracleShape,
                     core::Message("answers.found is ", static_cast<unsigned char>(*bad),
                                   " for query ", chunk.first + row, " but must be 0 or 1"),
                     "answers.found"},
                    row);
    }
    block.found.assign(found.begin(), found.end());
  }
  if (chunk.block().want.tangents && answers.has_tangents()) {
    status =
        CheckArray(answers.tangents(), {n, d, k}, "answers.tangents", StatusCode::kOracleShape);
    if (!status.ok()) return refuse(std::move(status));
    block.tangents = MatrixFromProto(answers.tangents(), static_cast<Index>(d * k), chunk.count);
  }
  if (chunk.block().want.sizes && answers.has_sizes()) {
    status = CheckArray(answers.sizes(), {n}, "answers.sizes", StatusCode::kOracleShape);
    if (!status.ok()) return refuse(std::move(status));
    block.sizes = MatrixFromProto(answers.sizes(), chunk.count, 1);
  }
  if (chunk.block().want.clearances) {
    status = WallsFromProto(answers, chunk, spec, &block);
    if (!status.ok()) return refuse(std::move(status));
  }
  return block;
}

}  // namespace stellate::server
