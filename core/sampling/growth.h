#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "core/base/instantiate.h"
#include "core/base/parcel.h"
#include "core/base/unset.h"
#include "core/index/ball_tree.h"
#include "core/index/runs.h"
#include "core/parts/numbers.h"
#include "core/parts/territory.h"
#include "core/sampling/lattice.h"

namespace stellate::core {

// Samples M at its final spacing by advancing-front lattice packing. From each seed a patch of the
// lattice A_k^* grows over M ring by ring, in the tangent spaces of its own points, until it meets
// the others. It leaves a hole where M bends too much, or where answers are missing.
//
//   growth.Begin(points, tangents, found);               // seeds
//   while ((ring = growth.Propose()).points.cols() > 0)  // the sites next to all new points
//     joined = growth.Join(closest points of the ring);
//
// If the spacing is graded, each point has a share in (0, 1]; lengths in spacings are multiplied
// by it. An answer whose share differs from the expected one does not join; if that is so of most
// answers, Propose returns nothing more.
//
// Parts of one sample each grow what lies in their territory, and know what lies around it: all
// call the same functions, with the same seeds, and each gets its own rings. Their points, put
// together, are those of the whole, the same bit for bit: of one size everywhere, with tangents.
//
// Deterministic: the same for any number of threads. Pure geometry, without queries.
template <int K>
class Growth {
 public:
  // d        ambient dimension
  // spacing  nearest-neighbour distance of the lattice, length; the largest where it is graded
  // predicts whether rings say how far M is expected to have bent away from them: the whole only
  Growth(int d, double spacing, bool predicts = false, Territory territory = {});

  // Makes seeds of those points of M, d x n with tangent bases (K rows of d) x n, that are found,
  // farther than `clearance` lattice spacings from all points so far, and `apart` spacings (times
  // the share) from each other. `shares`: of the spacing, n, or empty if it is not graded. Returns
  // the columns of the seeds, ascending.
  std::vector<Eigen::Index> Begin(const Eigen::MatrixXd& points, const Eigen::MatrixXd& tangents,
                                  const std::vector<std::uint8_t>& found, double apart,
                                  const Eigen::VectorXd& shares = {}, double clearance = 1);

  // The next sites of the lattice: points near M, d x n, with roughly orthonormal tangent bases, (K
  // rows of d) x n. Where it predicts, M is expected to bend there as it did at the points before:
  // `bends` leads from the points to M, d x n, zero in the first ring, and the tangent bases are
  // turned alike.
  struct Ring {
    Eigen::MatrixXd points, tangents;
    Eigen::MatrixXd bends;      // or empty
    Eigen::VectorXd spacing{};  // n, of the lattice there, length
  };
  Ring Propose();

  // Takes the closest points of the ring, tangent bases at them, and which were found; `shares` as
  // above. Returns the columns of those that join the sample, ascending. No two points of the
  // sample are nearer than kKeep spacings.
  std::vector<Eigen::Index> Join(const Eigen::MatrixXd& points, const Eigen::MatrixXd& tangents,
                                 const std::vector<std::uint8_t>& found,
                                 const Eigen::VectorXd& shares = {});

  // Of a part: what orders the columns of the last ring among those of all parts, whose numbers of
  // patches are the same.
  std::vector<OrderKey> RingKeys() const;
  std::uint32_t patches() const { return patches_; }

  // Frees its memory. Propose returns nothing afterwards.
  void Forget();

  // Returns the number of points so far: of a part, of those that it knows.
  std::uint32_t size() const { return size_; }
  // Returns the number of points that joined last.
  std::size_t border() const { return border_.size(); }
  double spacing() const { return spacing_; }
  // The largest distance of a site from the point that proposed it, length.
  double reach() const { return longest_; }

  // The least distance in the sample, in spacings. In a lattice of covering radius epsilon: 1.4
  // epsilon for k = 1; 1.2, 1.1, 1.0 and 0.9 for k = 2 to 5.
  static constexpr double kKeep = 0.72;

 private:
  using Numbers = UnsetVector<double>;
  // Proposals nearer to each other than this many spacings are one.
  static constexpr double kMerged = 0.5;
  // An answer farther than this many spacings from its query is no neighbour: M bends away.
  static constexpr double kFarthestAnswer = 1;
  // Places of the lattice: points that joined, or that are proposed.
  struct Sites {
    Numbers points;  // d each
    Numbers frames;  // K rows of d each: the lattice's directions
    // From where it was proposed to where it is, d, and so its frame, K rows of d; or empty.
    Numbers changes;
    Numbers shares;                    // of the spacing
    UnsetVector<std::uint32_t> patch;  // the seed that it came from
    UnsetVector<std::uint64_t> name;   // in the lattice of its patch
    std::size_t size() const { return patch.size(); }
    // Leaves new ones unset.
    void Resize(std::size_t count, std::size_t stride, bool predicts);
    // Sets one to zero, to add up others.
    void Clear(std::size_t at, std::size_t stride) {
      std::fill_n(points.data() + at * stride, stride, 0.0);
      std::fill_n(frames.data() + at * stride * K, stride * K, 0.0);
      if (!changes.empty())
        std::fill_n(changes.data() + at * stride * (K + 1), stride * (K + 1), 0.0);
      shares[at] = 0;
    }
    // Writes some sites of others, `columns`, from place `at` on.
    void Put(std::size_t at, const Sites& others, const std::vector<std::uint32_t>& columns);
    // As messages between parts, of one size everywhere.
    void PackTo(Peers::Bytes* message, const std::vector<std::uint32_t>& columns) const;
    void UnpackAt(std::size_t at, std::size_t count, std::size_t stride, Parcel* parcel);
  };
  // The means of proposals for one site.
  struct Proposed {
    // They are still to be written.
    explicit Proposed(std::size_t count = 0, std::size_t stride = 0, bool predicts = false);
    Sites sites;
    UnsetVector<std::uint16_t> parents;  // how many proposed it
    UnsetVector<std::uint32_t> first;    // the first of them, in the whole border
    Numbers clear;                       // no point is nearer than this, length
    OrderKey KeyOf(std::size_t i) const { return {sites.patch[i], sites.name[i], first[i]}; }
  };
  // The points of some rounds; layers of about the same size are merged.
  struct Layer {
    Layer(int d, Numbers placed, Numbers its_shares, double reach);
    Numbers points, shares;
    RunTree tree;
  };
  struct Proposal {
    std::uint64_t name;  // in the lattice of its patch
    std::uint32_t patch;
    std::uint32_t parent;     // in border_
    std::uint32_t direction;  // of the lattice
    double share;             // of the lattice's spacing, at the proposed site
    double clear;             // no point is nearer than this, length
  };

  std::size_t stride() const { return static_cast<std::size_t>(d_); }
  std::size_t change_stride() const { return predicts_ ? stride() * (K + 1) : 0; }
  Runs RunsOf(const Numbers& points, const Numbers& shares) const;
  // The points of the sample around a run.
  struct Placed {
    Numbers points;              // d each
    std::vector<double> shares;  // of the spacing
  };
  void GatherPlaced(const Runs& runs, std::size_t run, const Numbers& shares, double radius,
                    Placed* near) const;
  std::vector<std::uint8_t> AreFarFromPlaced(const Numbers& points, const Numbers& shares,
                                             double distance) const;
  void Land(const Proposal& proposal, double* point) const;
  void ProposeFrom(std::uint32_t p, const Placed& near, std::vector<Proposal>* free) const;
  std::vector<Proposal> FreePlaces() const;
  Proposed ByPlace(std::vector<Proposal> proposals) const;
  Proposed Merge(Proposed places, const Borders& borders) const;
  // Answers to proposals.
  struct Candidates {
    std::vector<std::uint32_t> columns;  // their proposals, ascending
    Numbers points, shares;              // d each; of the spacing
  };
  // Those of proposals `columns`, answered by `points` where `shares` are by proposal.
  Candidates CandidatesOf(const Eigen::MatrixXd& points, std::span<const double> shares,
                          std::vector<std::uint32_t> columns) const;
  std::vector<std::uint8_t> AreFree(const Candidates& candidates, const Proposed& proposed) const;
  // Candidates that are far from the sample, in the order of their proposals.
  struct Contenders {
    std::vector<std::uint32_t> columns;  // of their proposals; of another part's, kNoColumn
    std::vector<int> parents;            // of their proposals, how many
    Numbers points, shares;              // as of candidates
  };
  static constexpr std::uint32_t kNoColumn = 0xffffffff;
  Contenders ContendersOf(const Candidates& candidates, const Proposed& proposed) const;
  std::vector<std::uint32_t> Choose(const Candidates& candidates, const Proposed& proposed) const;
  // What parts tell each other (growth_parts.cc): nothing, where there is one.
  Borders SharePlaces(Proposed* places) const;
  Borders ShareContenders(const Proposed& proposed, Contenders* contenders) const;
  void ShareFar(const Candidates& candidates, std::vector<std::uint8_t>* far) const;
  void KeepNear(Sites* sites);
  void CarryToAll(const std::vector<OrderKey>& keys, Sites sites);
  double Halo() const;
  enum Fit : std::uint8_t { kMisfit, kFits, kUnexpected };
  std::vector<Fit> FitAnswers(const Eigen::MatrixXd& points, const Eigen::MatrixXd& tangents,
                              const std::vector<std::uint8_t>& found,
                              const Eigen::VectorXd& shares);
  void NoteChange(std::size_t asked, const double* point, const double* frame);
  void Carry(Sites sites);

  int d_;
  double spacing_;
  bool predicts_;
  Territory territory_;
  std::vector<double> vectors_;  // of the lattice, length, K each
  double longest_;               // of them
  LatticeNames names_{K};
  std::vector<std::unique_ptr<Layer>> layers_;
  bool is_graded_ = false;
  std::uint64_t answered_ = 0, unexpected_ = 0;  // answers with shares; those not as expected
  std::uint32_t size_ = 0;
  std::uint32_t patches_ = 0;
  Sites border_;
  // Of a part: the places of its border_ in that of the whole.
  std::vector<std::uint32_t> border_numbers_;
  Proposed asked_;
};

STELLATE_DECLARE_CLASS(Growth)

}  // namespace stellate::core
