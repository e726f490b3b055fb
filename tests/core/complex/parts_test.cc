// The stars of a sample may be built in parts, by whoever knows what lies within reach of its own
// points: together they are those of the whole, whatever the parts.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "core/complex/stars.h"
#include "tests/core/support/cells.h"
#include "tests/core/support/in_process_run.h"
#include "tests/core/support/samples.h"

namespace stellate::core {
namespace {

using testing::Canonical;
using testing::Drive;
using testing::FramedPoints;
using testing::Make;
using testing::RandomSample;
using testing::SpecificationFor;
using testing::TorusGrid;

template <int K>
using Cells = std::vector<decltype(Canonical(RestrictedVoronoiCell<K>()))>;

// What is known of a sample's stars: the cells, and the simplices by their lowest vertex.
template <int K>
struct BuiltStars {
  Cells<K> cells;
  std::vector<std::vector<std::uint32_t>> simplices;
  int asked_again = 0;  // times that a part had to ask for points farther off
};

struct Criteria {
  double epsilon;
  CentreRule centre_rule;
};

template <int K>
class Builder {
 public:
  Builder(const FramedPoints& sample, const Criteria& criteria)
      : sample_(sample), criteria_(criteria) {
    stars_.cells.resize(sample.size());
    stars_.simplices.resize(sample.size());
  }

  // `part_of`: by point.
  BuiltStars<K> InParts(int parts, const std::vector<int>& part_of) {
    for (int part = 0; part < parts; ++part) {
      own_.assign(sample_.size(), 0);
      for (std::uint32_t i = 0; i < sample_.size(); ++i) own_[i] = part_of[i] == part;
      BuildPart();
    }
    return std::move(stars_);
  }

 private:
  using Complex = Stars<K>;

  // A star that reaches farther than its part has looked asks for what lies there.
  void BuildPart() {
    looked_.assign(sample_.size(), kFirstLook * criteria_.epsilon);
    std::vector<std::uint32_t> names = Known();
    std::unique_ptr<Complex> stars = Lay(names);
    while (LookFarther(*stars, names)) {
      ++stars_.asked_again;
      names = Known();
      stars = Lay(names);
    }
    Keep(*stars, names);
  }

  // The points of its own and what lies within reach of them, ascending.
  std::vector<std::uint32_t> Known() const {
    std::vector<std::uint32_t> names;
    for (std::uint32_t q = 0; q < sample_.size(); ++q) {
      bool near = own_[q];
      for (std::uint32_t p = 0; p < sample_.size() && !near; ++p)
        near = own_[p] && Distance(sample_.Point(p), sample_.Point(q), sample_.d) <= looked_[p];
      if (near) names.push_back(q);
    }
    return names;
  }

  std::unique_ptr<Complex> Lay(const std::vector<std::uint32_t>& names) const {
    auto stars = std::make_unique<Complex>(sample_.d, criteria_.epsilon,
                                           StarOptions{3.0, criteria_.centre_rule});
    for (const std::uint32_t q : names) {
      stars->AddInBulk(sample_.Point(q), sample_.Tangent(q));
      stars->NameLast(q);
    }
    stars->Commit();
    return stars;
  }

  bool LookFarther(const Complex& stars, const std::vector<std::uint32_t>& names) {
    bool farther = false;
    for (std::uint32_t i = 0; i < names.size(); ++i) {
      const double reach = 2 * std::sqrt(stars.cell(i).max_norm2()) * (1 + 1e-9);
      if (!own_[names[i]] || reach <= looked_[names[i]]) continue;
      looked_[names[i]] = reach;
      farther = true;
    }
    return farther;
  }

  void Keep(const Complex& stars, const std::vector<std::uint32_t>& names) {
    const auto name = [&](std::uint32_t id) { return IsSample(id) ? names[id] : id; };
    for (std::uint32_t i = 0; i < names.size(); ++i) {
      if (!own_[names[i]]) continue;
      for (const auto& [facets, bits] : Canonical(stars.cell(i))) {
        auto named = facets;  // and as ascending as before
        for (std::uint32_t& id : named) id = name(id);
        stars_.cells[names[i]][named] = bits;
      }
    }
    const std::vector<std::uint32_t> simplices = stars.Simplices();
    for (std::size_t at = 0; at < simplices.size(); at += K + 1) {
      const std::uint32_t lowest = names[simplices[at]];
      if (!own_[lowest]) continue;
      for (std::size_t s = 0; s <= K; ++s)
        stars_.simplices[lowest].push_back(name(simplices[at + s]));
    }
  }

  static constexpr double kFirstLook = 2 * (1 + 1e-6);

  const FramedPoints& sample_;
  const Criteria criteria_;
  std::vector<std::uint8_t> own_;
  std::vector<double> looked_;  // around each of its own, length
  BuiltStars<K> stars_;
};

// Slabs along the first coordinate, about equally many points each.
std::vector<int> Slabs(const FramedPoints& sample, int parts) {
  std::vector<std::pair<double, std::uint32_t>> along;
  for (std::uint32_t i = 0; i < sample.size(); ++i) along.emplace_back(sample.Point(i)[0], i);
  std::sort(along.begin(), along.end());
  std::vector<int> part_of(sample.size());
  for (std::size_t i = 0; i < along.size(); ++i)
    part_of[along[i].second] = static_cast<int>(i * static_cast<std::size_t>(parts) / along.size());
  return part_of;
}

// As bad as can be: no two neighbours need be in one part.
std::vector<int> Scattered(const FramedPoints& sample, int parts) {
  std::vector<int> part_of(sample.size());
  for (std::uint32_t i = 0; i < sample.size(); ++i)
    part_of[i] = static_cast<int>(Mix64(i) % static_cast<std::uint64_t>(parts));
  return part_of;
}

// Returns the whole's, with how often all parts asked again.
template <int K>
BuiltStars<K> ExpectSameInParts(const FramedPoints& sample, const Criteria& criteria) {
  BuiltStars<K> whole = Builder<K>(sample, criteria).InParts(1, std::vector<int>(sample.size(), 0));
  whole.asked_again = 0;
  for (const int parts : {2, 3, 7})
    for (const auto& cut : {Slabs, Scattered}) {
      const BuiltStars<K> together =
          Builder<K>(sample, criteria).InParts(parts, cut(sample, parts));
      EXPECT_EQ(together.simplices, whole.simplices) << parts << " parts";
      for (std::uint32_t p = 0; p < sample.size(); ++p)
        EXPECT_EQ(together.cells[p], whole.cells[p]) << parts << " parts, star " << p;
      whole.asked_again += together.asked_again;
    }
  return whole;
}

// Of a finished mesh.
struct Finished {
  FramedPoints sample;
  std::vector<std::uint32_t> simplices;
};

Finished Mesh(const std::string& name, double epsilon) {
  const auto manifold = Make(name);
  const Specification spec = SpecificationFor(*manifold, epsilon);
  const auto run = Drive(spec, *manifold);
  EXPECT_EQ(run.report().termination, Termination::kConverged);
  Finished finished;
  finished.sample.d = spec.ambient_dimension;
  finished.sample.k = spec.dimension;
  finished.sample.Append(run.mesher->Points(), run.mesher->Tangents());
  finished.simplices = run.mesher->Simplices();
  return finished;
}

template <typename T>
std::vector<T> Joined(const std::vector<std::vector<T>>& lists) {
  std::vector<T> all;
  for (const auto& list : lists) all.insert(all.end(), list.begin(), list.end());
  return all;
}

TEST(Parts, OfAMeshOfASurfaceAreTheMesh) {
  const Finished mesh = Mesh("torus:1:0.4", 0.08);
  const auto whole = ExpectSameInParts<2>(mesh.sample, {0.08, CentreRule::kTangentSpace});
  EXPECT_EQ(Joined(whole.simplices), mesh.simplices);
  ExpectSameInParts<2>(mesh.sample, {0.08, CentreRule::kCommonCentre});
}

TEST(Parts, OfAMeshInThreeDimensionsHaveItsStars) {
  const Finished mesh = Mesh("flat-torus:3", 0.5);
  ExpectSameInParts<3>(mesh.sample, {0.5, CentreRule::kTangentSpace});
  ExpectSameInParts<3>(mesh.sample, {0.5, CentreRule::kCommonCentre});
}

// All neighbours are cospherical: the weights alone tell what the simplices are.
TEST(Parts, AgreeWherePointsAreCospherical) {
  ExpectSameInParts<2>(TorusGrid(2, 24), {0.2, CentreRule::kTangentSpace});
  ExpectSameInParts<3>(TorusGrid(3, 9), {0.62, CentreRule::kTangentSpace});
  ExpectSameInParts<3>(TorusGrid(3, 9), {0.62, CentreRule::kCommonCentre});
}

// Cells reach farther than 2 epsilon, or are open.
TEST(Parts, AskForWhatLiesFartherOff) {
  const auto torus = Make("torus:1:0.4");
  const FramedPoints sparse = RandomSample(*torus, 150, 3);
  EXPECT_GT(ExpectSameInParts<2>(sparse, {0.1, CentreRule::kTangentSpace}).asked_again, 0);
  const auto so3 = Make("so3");
  const FramedPoints sparser = RandomSample(*so3, 150, 3);
  EXPECT_GT(ExpectSameInParts<3>(sparser, {0.5, CentreRule::kTangentSpace}).asked_again, 0);
}

}  // namespace
}  // namespace stellate::core
