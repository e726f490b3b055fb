#pragma once

#include <grpcpp/support/sync_stream.h>

#include <algorithm>
#include <cstdint>
#include <functional>
#include <vector>

#include "stellate/oracle.h"
#include "stellate/v1/stellate.grpc.pb.h"

namespace stellate::client {

// The oracle behind a worker's stream: the server's side of ServeOracle, a chunk at a time. Methods
// throw std::runtime_error with what the worker said of its failure, or that it went away.
class AskedOracle final : public Oracle {
 public:
  using Stream = grpc::ServerReaderWriter<v1::ServeOracleResponse, v1::ServeOracleRequest>;

  // At most `max_chunk` queries in a chunk; 0: as many as a message should have.
  AskedOracle(Stream& stream, const v1::MeshSpec& spec, std::uint32_t max_chunk);

  int dimension() const override { return static_cast<int>(spec_.dimension()); }
  int ambient_dimension() const override { return static_cast<int>(spec_.ambient_dimension()); }
  bool has_intersect_flat() const override { return spec_.oracle().intersect_flat(); }
  bool has_tangent_basis() const override { return spec_.oracle().tangent_basis(); }
  bool has_local_size() const override { return spec_.oracle().local_size(); }
  std::optional<BoundingBox> bounding_box() const override;
  Eigen::MatrixXd seeds() const override;

  Answer ClosestPoint(const Eigen::MatrixXd& x) override;
  Answer IntersectFlat(const Eigen::MatrixXd& centers, const Eigen::MatrixXd& bases,
                       const Eigen::VectorXd& radii) override;
  // Closest points of points of M, asked for with their tangents or sizes.
  Eigen::MatrixXd TangentBasis(const Eigen::MatrixXd& points) override;
  Eigen::VectorXd LocalSize(const Eigen::MatrixXd& points) override;
  // Servers take no more walls than these.
  int walls() const override { return static_cast<int>(std::min(64u, spec_.walls())); }
  std::vector<std::uint8_t> labels() const override {
    return {spec_.labels().begin(), spec_.labels().end()};
  }
  Answer FacePoint(const Eigen::MatrixXd& x, const Walls& face) override;
  Eigen::MatrixXd Clearances(const Eigen::MatrixXd& points) override;
  Eigen::MatrixXd Conormals(const Eigen::MatrixXd& points, const Walls& face) override;

  // The worker failed, or has left: no query can be answered.
  bool lost() const { return lost_; }

 private:
  // Asks n queries in chunks; `fill` has the chunk ask for those from `first` on.
  Answer AskAll(
      Eigen::Index n,
      const std::function<void(Eigen::Index first, Eigen::Index count, v1::QueryChunk*)>& fill);
  Answer Ask(v1::QueryChunk* chunk, Eigen::Index count);
  Answer Read(const v1::QueryChunk& chunk, const v1::AnswerChunk& answers, Eigen::Index count);

  Stream& stream_;
  const v1::MeshSpec& spec_;
  Eigen::Index max_chunk_;
  std::uint64_t lease_ = 0;
  bool lost_ = false;
};

}  // namespace stellate::client
