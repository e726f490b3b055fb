#include "core/reconstruction/reconstructor.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numeric>
#include <span>
#include <string>
#include <utility>

#include "core/base/basis_layout.h"
#include "core/base/message.h"
#include "core/base/parallel.h"
#include "core/base/parallel_sort.h"
#include "core/index/indexed_points.h"
#include "core/reconstruction/assembly.h"
#include "core/reconstruction/causes.h"
#include "core/reconstruction/difference_tangents.h"
#include "core/reconstruction/fitted_cloud.h"
#include "core/reconstruction/judgement.h"
#include "core/reconstruction/open_boundary.h"
#include "core/specification.h"

namespace stellate::core {
namespace {

// The share of the time that each phase ends at.
constexpr double kIndexedBy = 0.03, kFittedBy = 0.4, kAssembledBy = 0.85;
// What coordinates are rounded to, as a share of the largest, and at most of how far points extend.
constexpr double kMerging = 1e-12, kMostMerging = 1e-9;
// Points for which weights are tried that may make a mesh provable: a minute or two.
constexpr std::size_t kMostExuded = 100'000;
// The same of surfaces, whose weights take a tenth of the time.
constexpr std::size_t kMostExudedOfSurface = 1'000'000;

// The distinct points: of equal ones the first.
struct Distinct {
  std::vector<std::uint32_t> rows;  // ascending
  std::vector<std::pair<std::uint32_t, std::uint32_t>> merged;
};

// Merges those that differ by rounding alone, as the first and the last of a closed curve, and all
// of a sphere's pole.
void MergeRounded(const Eigen::MatrixXd& points, Distinct* distinct) {
  const double largest = points.cwiseAbs().maxCoeff();
  const double extent = (points.rowwise().maxCoeff() - points.rowwise().minCoeff()).maxCoeff();
  const double radius = std::min(kMerging * largest, kMostMerging * extent);
  const std::vector<std::uint32_t>& rows = distinct->rows;
  IndexedPoints tree(static_cast<int>(points.rows()));
  for (const std::uint32_t row : rows) tree.AddUnindexed(points.col(row).data());
  tree.Index();
  std::vector<std::uint32_t> first(rows.size());
  ParallelFor(rows.size(), [&](std::uint32_t p) {
    first[p] = p;
    tree.tree().VisitNear(
        points.col(rows[p]).data(), [&] { return radius; },
        [&](std::uint32_t q, double) { first[p] = std::min(first[p], q); });
  });
  std::vector<std::uint32_t> kept;
  for (std::size_t p = 0; p < rows.size(); ++p) {
    first[p] = first[first[p]];  // of a chain the first of all
    if (first[p] == p)
      kept.push_back(rows[p]);
    else
      distinct->merged.emplace_back(rows[p], rows[first[p]]);
  }
  if (kept.size() == rows.size()) return;
  for (auto& [row, stands] : distinct->merged) {
    const auto at = std::lower_bound(rows.begin(), rows.end(), stands) - rows.begin();
    stands = rows[first[static_cast<std::size_t>(at)]];
  }
  distinct->rows = std::move(kept);
}

Distinct FindDistinct(const Eigen::MatrixXd& points) {
  const Eigen::Index d = points.rows();
  std::vector<std::uint32_t> order(static_cast<std::size_t>(points.cols()));
  std::iota(order.begin(), order.end(), 0u);
  const auto compare = [&](std::uint32_t p, std::uint32_t q) {
    const double *const a = points.col(p).data(), *const b = points.col(q).data();
    for (Eigen::Index i = 0; i < d; ++i)
      if (a[i] != b[i]) return a[i] < b[i] ? -1 : 1;
    return 0;
  };
  ParallelSort(order, [&](std::uint32_t p, std::uint32_t q) {
    const int order_of = compare(p, q);
    return order_of != 0 ? order_of < 0 : p < q;
  });
  Distinct distinct;
  for (std::size_t i = 0; i < order.size(); ++i) {
    CheckInterruption(i);
    if (i > 0 && compare(distinct.rows.back(), order[i]) == 0)
      distinct.merged.emplace_back(order[i], distinct.rows.back());
    else
      distinct.rows.push_back(order[i]);
  }
  ParallelSort(distinct.rows, std::less<>());
  MergeRounded(points, &distinct);
  ParallelSort(distinct.merged, std::less<>());
  return distinct;
}

class Reconstructor {
 public:
  Reconstructor(const ReconstructionSpecification& spec, const PointCloud& cloud,
                ReconstructionWatch* watch)
      : spec_(spec),
        given_(cloud),
        watch_(*watch),
        n_(static_cast<std::size_t>(cloud.points.cols())),
        d_(static_cast<std::size_t>(spec.ambient_dimension)),
        k_(static_cast<std::size_t>(spec.dimension)) {}

  Expected<Reconstruction> Run() {
    watch_.Advance(ReconstructionPhase::kIndexing, 0);
    distinct_ = FindDistinct(given_.points);
    if (distinct_.rows.size() < k_ + 2)
      return Refuse(StatusCode::kInvalidArgument,
                    Message("only ", distinct_.rows.size(), " of the ", n_,
                            " points are distinct but a closed manifold of dimension ", k_,
                            " needs at least ", k_ + 2),
                    "points");
    const double extent =
        (given_.points.rowwise().maxCoeff() - given_.points.rowwise().minCoeff()).maxCoeff();
    if (extent < kMinLength)
      return Refuse(StatusCode::kInvalidArgument,
                    Message("the points extend over ", extent, " but must extend over ", kMinLength,
                            " at least: change the unit"),
                    "points");
    watch_.Advance(ReconstructionPhase::kFitting, kIndexedBy);
    Fit();
    watch_.Advance(ReconstructionPhase::kBuilding, kFittedBy);
    Assemble();
    watch_.Advance(ReconstructionPhase::kCertifying, kAssembledBy);
    if (!spec_.closed) TrimBoundary(cloud_, &assembly_);
    causes_ = FindCauses(cloud_, assembly_, !spec_.closed);
    TakeToRows();
    Count();
    Judge();
    watch_.Advance(ReconstructionPhase::kDone, 1);
    return std::move(result_);
  }

 private:
  void Fit() {
    std::vector<double> points(distinct_.rows.size() * d_), tangents;
    ParallelFor(distinct_.rows.size(), [&](std::size_t p) {
      std::copy_n(given_.points.col(distinct_.rows[p]).data(), d_, points.data() + p * d_);
    });
    if (given_.tangents.size() > 0) {
      tangents.resize(distinct_.rows.size() * d_ * k_);
      ParallelFor(distinct_.rows.size(), [&](std::size_t p) {
        ToByVector(given_.tangents.col(distinct_.rows[p]).data(), spec_.ambient_dimension,
                   spec_.dimension, tangents.data() + p * d_ * k_);
      });
    }
    const FitRequest request{spec_.dimension, spec_.ambient_dimension, tangents, spec_.noise};
    cloud_ = FitCloud(std::move(points), request, [&](double share) {
      watch_.Advance(ReconstructionPhase::kFitting, kIndexedBy + share * (kFittedBy - kIndexedBy));
    });
  }

  void Assemble() {
    AssemblyRequest request;
    request.most_dropped = static_cast<std::uint64_t>(spec_.drop * static_cast<double>(n_));
    request.most_added = MostAdded(spec_, n_);
    // Tetrahedra that tilt are what a proof fails by; surfaces have none, and are proved as they
    // are.
    request.exudes = k_ == 3 && spec_.reach && spec_.noise == 0.0 && n_ <= kMostExuded;
    // A raster's squares have their four corners on one circle but for noise: stars disagree in all
    // of it, and cavities do not end.
    request.exudes_at_last = k_ <= 2 && !spec_.closed && n_ <= kMostExudedOfSurface;
    request.weights_only = spec_.weights == Weighting::kOnly;
    const auto done = [&](double share) {
      watch_.Advance(share < 1 ? ReconstructionPhase::kFilling : ReconstructionPhase::kCertifying,
                     kFittedBy + share * (kAssembledBy - kFittedBy));
    };
    switch (spec_.dimension) {
      case 1:
        assembly_ = core::Assemble<1>(&cloud_, request, done);
        return;
      case 2:
        assembly_ = core::Assemble<2>(&cloud_, request, done);
        return;
      default:
        static_assert(kMaxReconstructionDimension == 3);
        assembly_ = core::Assemble<3>(&cloud_, request, done);
    }
  }

  // Turns all that is by point of the cloud into the same by vertex: the given points, and then
  // those added.
  void TakeToRows() {
    const auto distinct = static_cast<std::uint32_t>(distinct_.rows.size());
    std::vector<std::uint32_t>& rows = distinct_.rows;
    for (std::uint32_t p = distinct; p < cloud_.size; ++p)
      rows.push_back(static_cast<std::uint32_t>(n_) + p - distinct);
    vertices_ = n_ + cloud_.size - distinct;
    const auto d = static_cast<Eigen::Index>(d_), k = static_cast<Eigen::Index>(k_);
    const auto n = static_cast<Eigen::Index>(vertices_);
    TakeAdded(distinct);
    result_.simplices = std::move(assembly_.simplices);
    for (std::uint32_t& id : result_.simplices) id = rows[id];
    result_.places.assign(vertices_, Place::kMerged);
    result_.noise.resize(vertices_);
    known_.causes.assign(vertices_, Place::kOk);
    known_.against = causes_.count;
    if (!assembly_.weights.empty()) result_.weights.resize(vertices_);
    result_.tangents.resize(d * k, n);
    if (cloud_.any_smoothed) result_.smoothed = positions();
    tangents_.resize(vertices_ * d_ * k_);
    const auto take = [&](std::uint32_t row, std::size_t p) {
      const double* const tangent = cloud_.Tangent(static_cast<std::uint32_t>(p));
      std::copy_n(tangent, d_ * k_, tangents_.data() + row * d_ * k_);
      ToByCoordinate(tangent, spec_.ambient_dimension, spec_.dimension,
                     result_.tangents.col(row).data());
      result_.noise[row] = cloud_.noise[p];
      if (cloud_.any_smoothed)
        std::copy_n(cloud_.Position(static_cast<std::uint32_t>(p)), d_,
                    result_.smoothed.col(row).data());
    };
    ParallelFor(rows.size(), [&](std::size_t p) {
      take(rows[p], p);
      const Place cause = causes_.places[p];
      result_.places[rows[p]] = cause == Place::kOk ? assembly_.places[p] : cause;
      known_.causes[rows[p]] = cause;
      if (!assembly_.weights.empty()) result_.weights[rows[p]] = assembly_.weights[p];
    });
    for (const auto& [row, first] : distinct_.merged)
      take(row, static_cast<std::size_t>(std::lower_bound(rows.begin(), rows.end(), first) -
                                         rows.begin()));
    result_.merged = std::move(distinct_.merged);
  }

  void TakeAdded(std::uint32_t distinct) {
    known_.added = cloud_.size - distinct;
    if (known_.added == 0) return;
    result_.added.resize(given_.points.rows(), static_cast<Eigen::Index>(known_.added));
    std::copy_n(cloud_.Position(distinct), result_.added.size(), result_.added.data());
    all_points_.resize(given_.points.rows(), static_cast<Eigen::Index>(vertices_));
    all_points_ << given_.points, result_.added;
  }

  // All vertices, where they were given, or added.
  const Eigen::MatrixXd& positions() const {
    return known_.added > 0 ? all_points_ : given_.points;
  }

  void Count() {
    ReconstructionCounts counts;
    for (const Place place : result_.places) ++counts.places[static_cast<std::size_t>(place)];
    std::vector<double> ratios(cloud_.size);
    ParallelFor(cloud_.size,
                [&](std::uint32_t p) { ratios[p] = cloud_.noise[p] / cloud_.spacing[p]; });
    counts.spacing = Median(cloud_.nearest);
    counts.noise = Median(cloud_.noise);
    counts.noise_ratio = Median(std::move(ratios));
    counts.smoothed = cloud_.any_smoothed;
    counts.doubtful = assembly_.doubtful;
    counts.cavities = assembly_.cavities;
    counts.tiles = assembly_.tiles;
    for (const Place place : assembly_.places)
      counts.unfilled_vertices += place == Place::kDisagree;
    for (const std::uint8_t extent : cloud_.extents)
      if (extent > 0) ++counts.looks[extent <= 4 ? extent : 0];
    for (double& share : counts.looks) share /= cloud_.size;
    result_.report.reconstruction = counts;
    result_.report.termination = Termination::kConverged;
    result_.report.counts.vertices = vertices_;
    result_.report.counts.simplices = result_.simplices.size() / (k_ + 1);
    result_.report.counts.duplicates = result_.merged.size();
  }

  void Judge() {
    unused_.resize(vertices_);
    for (std::size_t p = 0; p < vertices_; ++p)
      unused_[p] = result_.places[p] == Place::kMerged || result_.places[p] == Place::kDropped;
    known_.given = positions().data();
    known_.tangents_given = given_.tangents.size() > 0 && !cloud_.any_smoothed;
    const bool by_differences =
        spec_.reach && spec_.noise == 0.0 && !known_.tangents_given && known_.added == 0;
    ReconstructionSpecification spec = spec_;
    if (by_differences) spec.reach.reset();
    MeshView mesh = ViewOf(tangents_);
    OpenBoundary boundary;
    if (!spec_.closed) boundary = FindOpenBoundary(mesh);
    if (!boundary.faces.empty()) {
      mesh.walls = boundary.walls.data();
      mesh.outward = boundary.outward.data();
      mesh.faces = &boundary.faces;
    }
    JudgeReconstruction(spec, mesh, known_, &result_.report);
    if (by_differences) JudgeByDifferences();
  }

  MeshView ViewOf(const std::vector<double>& tangents) const {
    MeshView mesh;
    mesh.k = spec_.dimension;
    mesh.d = spec_.ambient_dimension;
    mesh.vertices = vertices_;
    mesh.points = result_.smoothed.size() > 0 ? result_.smoothed.data() : positions().data();
    mesh.tangents = tangents.data();
    mesh.simplices = &result_.simplices;
    mesh.unused = unused_.data();
    return mesh;
  }

  // Estimated tangent spaces have errors that no reach bounds: the proof is about others. Where it
  // fails, what the estimated ones say stays.
  void JudgeByDifferences() {
    Certificate& certificate = result_.report.certificate;
    if (certificate.level == CertificateLevel::kRefused) return;
    std::vector<std::uint8_t> asked(cloud_.size);
    for (std::size_t p = 0; p < asked.size(); ++p) asked[p] = unused_[distinct_.rows[p]] == 0;
    const DifferenceTangents found = FindDifferenceTangents(cloud_, asked);
    std::vector<double> tangents(tangents_.size());
    for (std::size_t p = 0; p < asked.size(); ++p)
      std::copy_n(found.tangents.data() + p * d_ * k_, d_ * k_,
                  tangents.data() + distinct_.rows[p] * d_ * k_);
    known_.tangent_error_length = found.error_length;
    Report proved = result_.report;
    JudgeReconstruction(spec_, ViewOf(tangents), known_, &proved);
    if (proved.certificate.level == CertificateLevel::kProved || proved.certificate.reach_refuted) {
      certificate = std::move(proved.certificate);
      return;
    }
    certificate.declared_reach = *spec_.reach;
    certificate.warnings.push_back(
        Message("Not proved for the declared reach ", Brief(*spec_.reach),
                ": tangent spaces from differences of the points may be wrong by a sine of ",
                Brief(found.error_length / *spec_.reach),
                "; give tangent spaces with the points, or more points."));
  }

  const ReconstructionSpecification& spec_;
  const PointCloud& given_;
  ReconstructionWatch& watch_;
  const std::size_t n_, d_, k_;
  std::size_t vertices_ = 0;
  Distinct distinct_;
  FittedCloud cloud_;
  Assembly assembly_;
  Causes causes_;
  Eigen::MatrixXd all_points_;        // d x vertices, if some were added
  std::vector<double> tangents_;      // by vertex, k rows of d each
  std::vector<std::uint8_t> unused_;  // by vertex: in no simplex, on purpose
  KnownOfPoints known_;
  Reconstruction result_;
};

}  // namespace

Expected<Reconstruction> ReconstructCloud(const ReconstructionSpecification& spec,
                                          const PointCloud& cloud, ReconstructionWatch* watch) {
  return Reconstructor(spec, cloud, watch).Run();
}

}  // namespace stellate::core
