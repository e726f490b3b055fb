#include "worker.h"

#include <algorithm>
#include <memory>
#include <utility>
#include <vector>

#include "convert.h"

namespace stellate::client {
namespace {

constexpr size_t kChunkBytes = 3 << 20;    // of numbers, under the 4 MB of a message
constexpr size_t kMaxFailureBytes = 4000;  // OracleFailure.message takes 4096

std::uint32_t MaxChunkQueries(const Oracle& oracle) {
  const size_t d = static_cast<size_t>(oracle.ambient_dimension());
  const size_t k = static_cast<size_t>(oracle.dimension());
  return static_cast<std::uint32_t>(std::max<size_t>(1, kChunkBytes / (8 * (d + d * k + 1))));
}

std::string DescriptionOf(const std::exception_ptr& exception) {
  try {
    std::rethrow_exception(exception);
  } catch (const std::exception& e) {
    return e.what();
  } catch (...) {
    return "an exception that is no std::exception";
  }
}

}  // namespace

Worker::Worker(v1::Stellate::StubInterface& stub, Oracle& oracle, std::string mesh,
               std::string name)
    : stub_(stub), oracle_(oracle), mesh_(std::move(mesh)), name_(std::move(name)) {}

// False, with error_ set, when the chunk makes no sense. Lets the oracle's exceptions through.
bool Worker::Answer(const v1::QueryChunk& chunk, v1::AnswerChunk* answers) {
  const std::uint32_t d = static_cast<std::uint32_t>(oracle_.ambient_dimension());
  const std::uint32_t k = static_cast<std::uint32_t>(oracle_.dimension());
  const auto points = FromArray(chunk.points(), {d});
  const auto bases = FromArray(chunk.bases(), {d, k});
  const auto radii = FromArray(chunk.radii(), {});
  const bool flats = chunk.kind() == v1::QUERY_KIND_INTERSECT_FLAT;
  if (!points || !bases || !radii ||
      (flats && (bases->cols() != points->cols() || radii->cols() != points->cols())) ||
      (!flats && chunk.kind() != v1::QUERY_KIND_CLOSEST_POINT)) {
    error_ = Error{ErrorCode::kServerFailed, "", "the server sent queries that make no sense"};
    return false;
  }
  stellate::Answer answer = flats
                                ? oracle_.IntersectFlat(*points, *bases, radii->row(0).transpose())
                                : oracle_.ClosestPoint(*points);
  // Points of a wrong shape are the server's to refuse; the oracle is not asked about them.
  const bool in_shape =
      answer.points.rows() == static_cast<Eigen::Index>(d) &&
      (answer.found.empty() || answer.found.size() >= static_cast<std::size_t>(answer.points.cols()));
  if (chunk.want_tangents() && in_shape && answer.tangents.size() == 0 &&
      oracle_.has_tangent_basis()) {
    // Only where there is a point to ask about; the server skips the other rows.
    std::vector<Eigen::Index> found;
    for (Eigen::Index j = 0; j < answer.points.cols(); ++j) {
      if (answer.IsFound(j)) found.push_back(j);
    }
    const Eigen::MatrixXd tangents = oracle_.TangentBasis(answer.points(Eigen::all, found));
    if (tangents.cols() == static_cast<Eigen::Index>(found.size())) {
      answer.tangents.setZero(tangents.rows(), answer.points.cols());
      answer.tangents(Eigen::all, found) = tangents;
    } else {
      answer.tangents = tangents;  // of the wrong size: the server says so
    }
  }
  answers->set_lease(chunk.lease());
  // As the oracle has them: the server checks the shapes and names what is wrong with them.
  ToArray(answer.points, {static_cast<std::uint32_t>(answer.points.rows())},
          answers->mutable_points());
  answers->set_found(answer.found.data(), answer.found.size());
  if (answer.tangents.size() > 0) {
    const std::uint32_t rows = static_cast<std::uint32_t>(answer.tangents.rows());
    const std::vector<std::uint32_t> shape =
        rows == d * k ? std::vector<std::uint32_t>{d, k} : std::vector<std::uint32_t>{rows};
    ToArray(answer.tangents, shape, answers->mutable_tangents());
  }
  return true;
}

void Worker::Run() {
  const auto stream = stub_.ServeOracle(&context_);
  v1::ServeOracleRequest request;
  request.mutable_hello()->set_mesh(mesh_);
  request.mutable_hello()->set_worker(name_);
  request.mutable_hello()->set_max_chunk_queries(MaxChunkQueries(oracle_));
  bool open = stream->Write(request), over = false;
  v1::ServeOracleResponse response;
  while (open && stream->Read(&response)) {
    if (response.has_over()) over = true;
    if (!response.has_queries()) continue;
    request.Clear();
    try {
      if (!Answer(response.queries(), request.mutable_answers())) {
        context_.TryCancel();
        break;
      }
    } catch (...) {
      exception_ = std::current_exception();
      request.Clear();
      request.mutable_failure()->set_lease(response.queries().lease());
      request.mutable_failure()->set_message(DescriptionOf(exception_).substr(0, kMaxFailureBytes));
      open = false;
    }
    if (!stream->Write(request)) break;
  }
  stream->WritesDone();
  // What is left unread would keep Finish from returning.
  while (stream->Read(&response)) over = over || response.has_over();
  const grpc::Status status = stream->Finish();
  if (!exception_ && !error_ && !over && !status.ok()) error_ = FromStatus(status);
}

}  // namespace stellate::client
