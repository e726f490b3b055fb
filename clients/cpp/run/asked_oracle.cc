#include "run/asked_oracle.h"

#include <algorithm>
#include <stdexcept>
#include <string>
#include <utility>

#include "wire/convert.h"

namespace stellate::client {
namespace {

constexpr Eigen::Index kArrayBytes = 1 << 20;  // of a chunk's arrays, as oracle.proto says

Eigen::MatrixXd ArrayOr(const v1::Array& array, const std::vector<std::uint32_t>& shape,
                        const std::string& what) {
  Expected<Eigen::MatrixXd> columns = FromArray(array, shape);
  if (!columns) throw std::runtime_error(what + " do not have the shape of oracle.proto");
  return std::move(*columns);
}

void Append(const Answer& part, Answer* all) {
  const auto join = [](const auto& more, auto* columns) {
    const Eigen::Index rows = more.rows(), before = columns->cols();
    columns->conservativeResize(rows, before + more.cols());
    columns->rightCols(more.cols()) = more;
  };
  if (!part.found.empty() || !all->found.empty()) {
    all->found.resize(static_cast<size_t>(all->points.cols()), 1);
    for (Eigen::Index j = 0; j < part.points.cols(); ++j) all->found.push_back(part.IsFound(j));
  }
  join(part.points, &all->points);
  if (part.tangents.size() > 0) join(part.tangents, &all->tangents);
  if (part.clearances.size() > 0) join(part.clearances, &all->clearances);
  if (part.conormals.size() > 0) join(part.conormals, &all->conormals);
  const Eigen::Index sizes = all->sizes.size();
  all->sizes.conservativeResize(sizes + part.sizes.size());
  all->sizes.tail(part.sizes.size()) = part.sizes;
}

}  // namespace

AskedOracle::AskedOracle(Stream& stream, const v1::MeshSpec& spec, std::uint32_t max_chunk)
    : stream_(stream), spec_(spec) {
  const Eigen::Index d = std::max(1, ambient_dimension()), k = std::max(1, dimension());
  max_chunk_ = std::max<Eigen::Index>(1, kArrayBytes / (8 * (d + d * k + 2)));
  if (max_chunk > 0) max_chunk_ = std::min<Eigen::Index>(max_chunk_, max_chunk);
}

std::optional<BoundingBox> AskedOracle::bounding_box() const {
  if (!spec_.has_bounding_box()) return std::nullopt;
  const auto corner = [](const v1::Array& array) {
    return Eigen::VectorXd(ArrayOr(array, {}, "the box's corners").row(0).transpose());
  };
  return BoundingBox{corner(spec_.bounding_box().lower()), corner(spec_.bounding_box().upper())};
}

Eigen::MatrixXd AskedOracle::seeds() const {
  return ArrayOr(spec_.seeds(), {spec_.ambient_dimension()}, "the seeds");
}

Answer AskedOracle::ClosestPoint(const Eigen::MatrixXd& x) {
  return AskAll(x.cols(), [&](Eigen::Index first, Eigen::Index count, v1::QueryChunk* chunk) {
    ToArray(x.middleCols(first, count), {spec_.ambient_dimension()}, chunk->mutable_points());
  });
}

Answer AskedOracle::IntersectFlat(const Eigen::MatrixXd& centers, const Eigen::MatrixXd& bases,
                                  const Eigen::VectorXd& radii) {
  const std::uint32_t d = spec_.ambient_dimension();
  return AskAll(centers.cols(), [&](Eigen::Index first, Eigen::Index count, v1::QueryChunk* chunk) {
    chunk->set_kind(v1::QUERY_KIND_INTERSECT_FLAT);
    ToArray(centers.middleCols(first, count), {d}, chunk->mutable_points());
    ToArray(bases.middleCols(first, count), {d, spec_.dimension()}, chunk->mutable_bases());
    ToArray(radii.segment(first, count).transpose(), {}, chunk->mutable_radii());
  });
}

Eigen::MatrixXd AskedOracle::TangentBasis(const Eigen::MatrixXd& points) {
  return AskAll(points.cols(),
                [&](Eigen::Index first, Eigen::Index count, v1::QueryChunk* chunk) {
                  ToArray(points.middleCols(first, count), {spec_.ambient_dimension()},
                          chunk->mutable_points());
                  chunk->set_want_tangents(true);
                })
      .tangents;
}

Eigen::VectorXd AskedOracle::LocalSize(const Eigen::MatrixXd& points) {
  return AskAll(points.cols(),
                [&](Eigen::Index first, Eigen::Index count, v1::QueryChunk* chunk) {
                  ToArray(points.middleCols(first, count), {spec_.ambient_dimension()},
                          chunk->mutable_points());
                  chunk->set_want_sizes(true);
                })
      .sizes;
}

Answer AskedOracle::FacePoint(const Eigen::MatrixXd& x, const Walls& face) {
  return AskAll(x.cols(), [&](Eigen::Index first, Eigen::Index count, v1::QueryChunk* chunk) {
    ToArray(x.middleCols(first, count), {spec_.ambient_dimension()}, chunk->mutable_points());
    chunk->mutable_face()->Assign(face.begin(), face.end());
    chunk->set_want_tangents(true);
    chunk->set_want_clearances(true);
  });
}

Eigen::MatrixXd AskedOracle::Clearances(const Eigen::MatrixXd& points) {
  return FacePoint(points, {}).clearances;
}

Eigen::MatrixXd AskedOracle::Conormals(const Eigen::MatrixXd& points, const Walls& face) {
  return FacePoint(points, face).conormals;
}

Answer AskedOracle::AskAll(
    Eigen::Index n, const std::function<void(Eigen::Index, Eigen::Index, v1::QueryChunk*)>& fill) {
  Answer all;
  all.points.resize(ambient_dimension(), 0);
  for (Eigen::Index first = 0; first < n; first += max_chunk_) {
    const Eigen::Index count = std::min(max_chunk_, n - first);
    v1::ServeOracleResponse response;
    response.mutable_queries()->set_kind(v1::QUERY_KIND_CLOSEST_POINT);
    fill(first, count, response.mutable_queries());
    Append(Ask(response.mutable_queries(), count), &all);
  }
  return all;
}

Answer AskedOracle::Ask(v1::QueryChunk* chunk, Eigen::Index count) {
  chunk->set_lease(++lease_);
  v1::ServeOracleResponse response;
  response.mutable_queries()->Swap(chunk);
  v1::ServeOracleRequest request;
  if (!lost_ && stream_.Write(response)) {
    while (stream_.Read(&request)) {
      if (request.has_answers() && request.answers().lease() == lease_) {
        return Read(response.queries(), request.answers(), count);
      }
      if (request.has_busy()) continue;
      lost_ = true;
      throw std::runtime_error(request.has_failure() ? request.failure().message()
                                                     : "the worker broke the protocol");
    }
  }
  lost_ = true;
  throw std::runtime_error("the worker went away before it had answered");
}

Answer AskedOracle::Read(const v1::QueryChunk& chunk, const v1::AnswerChunk& answers,
                         Eigen::Index count) {
  const std::uint32_t d = spec_.ambient_dimension();
  Answer answer;
  answer.points = ArrayOr(answers.points(), {d}, "the points");
  answer.found.assign(answers.found().begin(), answers.found().end());
  if (chunk.want_tangents()) {
    answer.tangents = ArrayOr(answers.tangents(), {d, spec_.dimension()}, "the tangents");
  }
  if (chunk.want_sizes())
    answer.sizes = ArrayOr(answers.sizes(), {}, "the sizes").row(0).transpose();
  if (chunk.want_clearances()) {
    answer.clearances =
        ArrayOr(answers.clearances(), {static_cast<std::uint32_t>(walls())}, "the clearances");
  }
  if (chunk.face_size() > 0) {
    const auto on = static_cast<std::uint32_t>(chunk.face_size());
    answer.conormals = ArrayOr(answers.conormals(), {on, d}, "the conormals");
  }
  const auto right = [count](Eigen::Index columns) { return columns == count; };
  if (!right(answer.points.cols()) ||
      !(answer.found.empty() || right(static_cast<Eigen::Index>(answer.found.size()))) ||
      (chunk.want_tangents() && !right(answer.tangents.cols())) ||
      (chunk.want_sizes() && !right(answer.sizes.size())) ||
      (chunk.want_clearances() && !right(answer.clearances.cols())) ||
      (chunk.face_size() > 0 && !right(answer.conormals.cols()))) {
    throw std::runtime_error("it does not answer " + std::to_string(count) + " queries");
  }
  return answer;
}

}  // namespace stellate::client
