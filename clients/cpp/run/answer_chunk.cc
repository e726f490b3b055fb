#include "run/answer_chunk.h"

#include <utility>
#include <vector>

#include "wire/convert.h"

namespace stellate::client {
namespace {

using Eigen::Index, Eigen::MatrixXd;
using Shape = std::vector<std::uint32_t>;

// What the oracle says of the points that were found, zeros for the others, which the server skips.
template <typename Ask>
MatrixXd AtFound(const Answer& answer, const Ask& ask) {
  std::vector<Index> found;
  for (Index j = 0; j < answer.points.cols(); ++j) {
    if (answer.IsFound(j)) found.push_back(j);
  }
  if (static_cast<Index>(found.size()) == answer.points.cols()) return ask(answer.points);
  MatrixXd values = ask(answer.points(Eigen::all, found));
  if (values.cols() != static_cast<Index>(found.size())) return values;  // the server says so
  MatrixXd all = MatrixXd::Zero(values.rows(), answer.points.cols());
  all(Eigen::all, found) = values;
  return all;
}

struct Question {
  MatrixXd points, bases, radii;
  Walls face;
  bool flats = false;
};

bool Read(const Oracle& oracle, const v1::QueryChunk& chunk, Question* question) {
  const auto d = static_cast<std::uint32_t>(oracle.ambient_dimension());
  const auto k = static_cast<std::uint32_t>(oracle.dimension());
  auto points = FromArray(chunk.points(), {d});
  auto bases = FromArray(chunk.bases(), {d, k});
  auto radii = FromArray(chunk.radii(), {});
  if (!points || !bases || !radii) return false;
  const Index n = points->cols();
  question->flats = chunk.kind() == v1::QUERY_KIND_INTERSECT_FLAT;
  if (question->flats && (bases->cols() != n || radii->cols() != n)) return false;
  if (!question->flats && chunk.kind() != v1::QUERY_KIND_CLOSEST_POINT) return false;
  for (const std::uint32_t wall : chunk.face()) {
    const bool known = wall < static_cast<std::uint32_t>(oracle.walls());
    const bool ascends = question->face.empty() || static_cast<int>(wall) > question->face.back();
    if (!known || !ascends || question->flats) return false;
    question->face.push_back(static_cast<int>(wall));
  }
  question->points = std::move(*points);
  question->bases = std::move(*bases);
  question->radii = std::move(*radii);
  return true;
}

Answer Ask(Oracle& oracle, const Question& question) {
  if (question.flats) {
    return oracle.IntersectFlat(question.points, question.bases, question.radii.row(0).transpose());
  }
  return question.face.empty() ? oracle.ClosestPoint(question.points)
                               : oracle.FacePoint(question.points, question.face);
}

// [n, vectors, d], or what the oracle made of it.
void WriteVectors(const MatrixXd& columns, const Shape& expected, v1::Array* array) {
  const auto rows = static_cast<std::uint32_t>(columns.rows());
  ToArray(columns, rows == expected[0] * expected[1] ? expected : Shape{rows}, array);
}

void WriteWalls(Oracle& oracle, const Walls& face, const Answer& answer, v1::AnswerChunk* answers) {
  const MatrixXd clearances =
      answer.clearances.size() > 0
          ? answer.clearances
          : AtFound(answer, [&](const MatrixXd& points) { return oracle.Clearances(points); });
  ToArray(clearances, {static_cast<std::uint32_t>(clearances.rows())},
          answers->mutable_clearances());
  if (face.empty()) return;
  WriteVectors(
      answer.conormals.size() > 0
          ? answer.conormals
          : AtFound(answer, [&](const MatrixXd& points) { return oracle.Conormals(points, face); }),
      {static_cast<std::uint32_t>(face.size()),
       static_cast<std::uint32_t>(oracle.ambient_dimension())},
      answers->mutable_conormals());
}

}  // namespace

bool AnswerChunk(Oracle& oracle, const v1::QueryChunk& chunk, v1::AnswerChunk* answers) {
  Question question;
  if (!Read(oracle, chunk, &question)) return false;
  const auto d = static_cast<std::uint32_t>(oracle.ambient_dimension());
  const auto k = static_cast<std::uint32_t>(oracle.dimension());
  Answer answer = Ask(oracle, question);
  // Points of a wrong shape are the server's to refuse; the oracle is not asked about them.
  const bool in_shape = answer.points.rows() == static_cast<Index>(d) &&
                        (answer.found.empty() ||
                         answer.found.size() >= static_cast<std::size_t>(answer.points.cols()));
  if (chunk.want_tangents() && in_shape && answer.tangents.size() == 0 &&
      oracle.has_tangent_basis()) {
    answer.tangents =
        AtFound(answer, [&](const MatrixXd& points) { return oracle.TangentBasis(points); });
  }
  if (chunk.want_sizes() && in_shape && answer.sizes.size() == 0 && oracle.has_local_size()) {
    answer.sizes = AtFound(answer,
                           [&](const MatrixXd& points) -> MatrixXd {
                             return oracle.LocalSize(points).transpose();
                           })
                       .row(0)
                       .transpose();
  }
  answers->set_lease(chunk.lease());
  ToArray(answer.points, {static_cast<std::uint32_t>(answer.points.rows())},
          answers->mutable_points());
  answers->set_found(answer.found.data(), answer.found.size());
  if (answer.tangents.size() > 0) {
    WriteVectors(answer.tangents, {d, k}, answers->mutable_tangents());
  }
  if (chunk.want_sizes() && answer.sizes.size() > 0) {
    ToArray(answer.sizes.transpose(), {}, answers->mutable_sizes());
  }
  if (chunk.want_clearances() && in_shape) WriteWalls(oracle, question.face, answer, answers);
  return true;
}

}  // namespace stellate::client
