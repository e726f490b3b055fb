#include "core/reconstruction.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "core/base/arenas.h"
#include "core/base/basis_layout.h"
#include "core/base/message.h"
#include "core/base/vector_ops.h"
#include "core/batch.h"
#include "core/field_status.h"
#include "core/reconstruction/reconstructor.h"
#include "core/specification.h"

namespace stellate::core {
namespace {

constexpr double kMostDropped = 0.5;
constexpr Eigen::Index kMostPoints = 0x7fffffff;  // ids above are taken

Status CheckDimensions(int k, int d) {
  if (k < 1)
    return Invalid("dimension", Message("dimension (k) is ", k,
                                        " but must be at least 1: set it to the dimension of the "
                                        "manifold that the points lie on"));
  if (k > kMaxReconstructionDimension)
    return TooLarge("dimension", Message("dimension (k) is ", k,
                                         " but this build reconstructs manifolds of dimension up "
                                         "to ",
                                         kMaxReconstructionDimension));
  if (d > kMaxAmbientDimension)
    return TooLarge("ambient_dimension",
                    Message("ambient_dimension (d) is ", d, " but may be at most ",
                            kMaxAmbientDimension, ": project the points to fewer coordinates"));
  if (k >= d)
    return Invalid("dimension", Message("dimension (k) is ", k, " and ambient_dimension (d) is ", d,
                                        " but k must be less than d"));
  return Status::Ok();
}

Status CheckPoints(const Eigen::MatrixXd& points) {
  for (Eigen::Index p = 0; p < points.cols(); ++p)
    for (Eigen::Index i = 0; i < points.rows(); ++i) {
      const double x = points(i, p);
      if (std::abs(x) <= kMaxLength) continue;
      return Invalid("points", Message("point ", p, " is ", x, " in coordinate ", i,
                                       " but coordinates must be finite and at most ", kMaxLength,
                                       ": leave the point out, or change the unit"));
    }
  return Status::Ok();
}

Status CheckTangents(const Eigen::MatrixXd& tangents, int k, int d) {
  std::vector<double> rows(static_cast<std::size_t>(k) * static_cast<std::size_t>(d));
  for (Eigen::Index p = 0; p < tangents.cols(); ++p) {
    ToByVector(tangents.col(p).data(), d, k, rows.data());
    for (int a = 0; a < k; ++a)
      for (int b = 0; b <= a; ++b) {
        const double dot = Dot(rows.data() + a * d, rows.data() + b * d, d);
        if (std::abs(dot - (a == b ? 1 : 0)) <= kOrthonormalTolerance) continue;
        return Invalid("tangents",
                       Message("the tangent vectors of point ", p, " are not orthonormal: vectors ",
                               a, " and ", b, " have the product ", dot,
                               ": orthonormalise them, columns being tangent vectors"));
      }
  }
  return Status::Ok();
}

}  // namespace

Status Validate(const ReconstructionSpecification& spec) {
  if (Status status = CheckDimensions(spec.dimension, spec.ambient_dimension); !status.ok())
    return status;
  if (spec.noise && *spec.noise != 0 && !IsLength(*spec.noise))
    return Invalid("noise", Message("noise is ", *spec.noise, " but must be 0 or a length between ",
                                    kMinLength, " and ", kMaxLength,
                                    ": give the standard deviation of a coordinate, or leave it "
                                    "out"));
  if (!(spec.drop >= 0 && spec.drop <= kMostDropped))
    return Invalid("drop",
                   Message("drop is ", spec.drop, " but must be between 0 and ", kMostDropped,
                           ": give the share of the points that may be left "
                           "out"));
  if (spec.reach && !IsLength(*spec.reach))
    return Invalid("reach", Message("reach is ", *spec.reach, " but must be a length between ",
                                    kMinLength, " and ", kMaxLength, ", or left out"));
  if (spec.reach && !spec.closed)
    return Invalid("reach",
                   "reach is set together with closed = false, but only manifolds without boundary "
                   "can be proved: leave one of them out");
  return Status::Ok();
}

Status Validate(const ReconstructionSpecification& spec, const PointCloud& cloud) {
  const int k = spec.dimension, d = spec.ambient_dimension;
  const Eigen::Index n = cloud.points.cols();
  if (cloud.points.rows() != d && n > 0)
    return Invalid("points", Message("points have ", cloud.points.rows(),
                                     " coordinates but ambient_dimension (d) is ", d));
  if (n < k + 2)
    return Invalid("points", Message("there are ", n, " points but a closed manifold of dimension ",
                                     k, " needs at least ", k + 2));
  if (n > kMostPoints)
    return TooLarge("points", Message("there are ", n, " points but may be at most ", kMostPoints));
  if (cloud.tangents.size() != 0 &&
      (cloud.tangents.rows() != Eigen::Index{d} * k || cloud.tangents.cols() != n))
    return Invalid("tangents", Message("tangents hold ", cloud.tangents.size(), " numbers but ", n,
                                       " bases of ", k, " vectors in R^", d, " need ", n * d * k));
  if (Status status = CheckPoints(cloud.points); !status.ok()) return status;
  return CheckTangents(cloud.tangents, k, d);
}

const char* ReconstructionPhaseName(ReconstructionPhase phase) {
  switch (phase) {
    case ReconstructionPhase::kIndexing:
      return "INDEXING";
    case ReconstructionPhase::kFitting:
      return "FITTING";
    case ReconstructionPhase::kBuilding:
      return "BUILDING";
    case ReconstructionPhase::kFilling:
      return "FILLING";
    case ReconstructionPhase::kCertifying:
      return "CERTIFYING";
    case ReconstructionPhase::kDone:
      return "DONE";
  }
  return "UNKNOWN";
}

void ReconstructionWatch::Advance(ReconstructionPhase phase, double fraction) {
  phase_ = static_cast<int>(phase);
  fraction_ = std::max(fraction_.load(), fraction);
}

Expected<Reconstruction> Reconstruct(const ReconstructionSpecification& spec,
                                     const PointCloud& cloud, Execution execution,
                                     ReconstructionWatch* watch) {
  if (Status status = Validate(spec); !status.ok()) return tl::unexpected(status);
  if (Status status = Validate(spec, cloud); !status.ok()) return tl::unexpected(status);
  if (Status status = Validate(execution); !status.ok()) return tl::unexpected(status);
  ReconstructionWatch own;
  if (!watch) watch = &own;
  Expected<Reconstruction> result;
  const bool finished = WithThreads(execution.threads, watch->interruption(),
                                    [&] { result = ReconstructCloud(spec, cloud, watch); });
  if (!finished) return Refuse(StatusCode::kCancelled, "the reconstruction was cancelled");
  return result;
}

}  // namespace stellate::core
