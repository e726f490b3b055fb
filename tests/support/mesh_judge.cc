#include "support/mesh_judge.h"

#include <algorithm>
#include <functional>
#include <iterator>
#include <map>
#include <set>
#include <sstream>

#include "support/homology.h"

namespace stellate::testing {
namespace {

// The facets of the link of each vertex.
std::map<std::uint32_t, std::vector<Facet>> Links(const std::vector<Facet>& facets) {
  std::map<std::uint32_t, std::vector<Facet>> links;
  for (const Facet& facet : facets) {
    for (const std::uint32_t v : facet) {
      Facet rest;
      std::copy_if(facet.begin(), facet.end(), std::back_inserter(rest),
                   [v](std::uint32_t u) { return u != v; });
      links[v].push_back(std::move(rest));
    }
  }
  return links;
}

int Components(const std::vector<Facet>& facets) {
  std::map<std::uint32_t, std::uint32_t> parent;
  const auto root = [&](std::uint32_t v) {
    while (parent[v] != v) v = parent[v] = parent[parent[v]];
    return v;
  };
  for (const Facet& facet : facets) {
    for (const std::uint32_t v : facet) parent.emplace(v, v);
  }
  for (const Facet& facet : facets) {
    for (const std::uint32_t v : facet) parent[root(v)] = root(facet.front());
  }
  return static_cast<int>(std::count_if(
      parent.begin(), parent.end(), [](const auto& entry) { return entry.first == entry.second; }));
}

// By counting distinct faces of every dimension.
std::int64_t EulerCharacteristic(const std::vector<Facet>& facets) {
  std::set<Facet> faces;
  for (const Facet& facet : facets) {
    for (unsigned subset = 1; subset < 1u << facet.size(); ++subset) {
      Facet face;
      for (size_t i = 0; i < facet.size(); ++i) {
        if ((subset >> i & 1u) != 0) face.push_back(facet[i]);
      }
      faces.insert(std::move(face));
    }
  }
  std::int64_t sum = 0;
  for (const Facet& face : faces) sum += face.size() % 2 == 1 ? 1 : -1;
  return sum;
}

// Whether the complex of these n-dimensional facets is an n-sphere: for n <= 2 exactly (the
// classification of curves and surfaces), above by links and homology.
bool IsSphere(const std::vector<Facet>& facets, int n) {
  if (n == 0) return facets.size() == 2 && facets[0] != facets[1];
  for (const auto& [vertex, link] : Links(facets)) {
    if (!IsSphere(link, n - 1)) return false;
  }
  if (Components(facets) != 1) return false;
  if (n == 1) return true;
  if (EulerCharacteristic(facets) != (n % 2 == 0 ? 2 : 0)) return false;
  if (n == 2) return true;
  std::vector<int> sphere(static_cast<size_t>(n) + 1, 0);
  sphere.front() = sphere.back() = 1;
  return BettiNumbers(facets, 2) == sphere && BettiNumbers(facets, 3) == sphere;
}

std::uint64_t BadFaces(const std::vector<Facet>& facets) {
  std::map<Facet, int> counts;
  for (const Facet& facet : facets) {
    for (size_t drop = 0; drop < facet.size(); ++drop) {
      Facet face = facet;
      face.erase(face.begin() + static_cast<std::ptrdiff_t>(drop));
      ++counts[face];
    }
  }
  return static_cast<std::uint64_t>(std::count_if(
      counts.begin(), counts.end(), [](const auto& entry) { return entry.second != 2; }));
}

std::string Show(const std::vector<int>& numbers) {
  std::ostringstream text;
  for (const int number : numbers) text << " " << number;
  return text.str();
}

}  // namespace

Judgement Judge(const SimplexMatrix& simplices, std::uint64_t vertices) {
  Judgement judgement;
  const int k = static_cast<int>(simplices.rows()) - 1;
  std::vector<Facet> facets;
  for (Eigen::Index j = 0; j < simplices.cols(); ++j) {
    Facet facet(simplices.col(j).begin(), simplices.col(j).end());
    if (std::adjacent_find(facet.begin(), facet.end(), std::greater_equal<>()) != facet.end() ||
        facet.back() >= vertices) {
      judgement.valid = false;
    }
    facets.push_back(std::move(facet));
  }
  if (std::set<Facet>(facets.begin(), facets.end()).size() != facets.size()) {
    judgement.valid = false;
  }
  if (!judgement.valid || facets.empty()) return judgement;
  const auto links = Links(facets);
  judgement.unused_vertices = vertices - links.size();
  judgement.bad_faces = BadFaces(facets);
  for (const auto& [vertex, link] : links) {
    if (!IsSphere(link, k - 1)) ++judgement.bad_links;
  }
  judgement.components = Components(facets);
  judgement.euler_characteristic = EulerCharacteristic(facets);
  judgement.betti_mod2 = BettiNumbers(facets, 2);
  judgement.betti_mod3 = BettiNumbers(facets, 3);
  // A closed connected k-manifold has a fundamental class over Z/3 just when it is orientable.
  judgement.orientable = judgement.betti_mod3.back() == judgement.components;
  return judgement;
}

::testing::AssertionResult IsFaithful(const Mesh& mesh, Manifold& manifold, double epsilon) {
  const auto wrong = [&] {
    return ::testing::AssertionFailure()
           << manifold.facts().spec << " at epsilon " << epsilon << ": ";
  };
  if (!mesh.report.certified()) return wrong() << "not certified\n" << mesh.report.text;
  const Judgement seen = Judge(mesh.simplices, static_cast<std::uint64_t>(mesh.points.cols()));
  if (!seen.IsClosedManifold()) {
    return wrong() << "no closed manifold: valid " << seen.valid << ", unused vertices "
                   << seen.unused_vertices << ", bad faces " << seen.bad_faces << ", bad links "
                   << seen.bad_links;
  }
  const ManifoldFacts& facts = manifold.facts();
  if (seen.betti_mod2 != facts.betti_mod2 || seen.betti_mod3 != facts.betti_mod3 ||
      seen.orientable != facts.orientable ||
      seen.euler_characteristic != facts.euler_characteristic) {
    return wrong() << "Euler characteristic " << seen.euler_characteristic
                   << ", Betti numbers mod 2" << Show(seen.betti_mod2) << ", mod 3"
                   << Show(seen.betti_mod3) << "; should be " << facts.euler_characteristic << ","
                   << Show(facts.betti_mod2) << "," << Show(facts.betti_mod3);
  }
  const Certificate& claimed = mesh.report.certificate;
  if (claimed.euler_characteristic != seen.euler_characteristic ||
      claimed.orientable != seen.orientable ||
      claimed.components != static_cast<std::uint64_t>(seen.components) || !claimed.closed ||
      !claimed.links_are_spheres) {
    return wrong() << "the report claims another topology\n" << mesh.report.text;
  }
  const double off = manifold.Distance(mesh.points).maxCoeff();
  if (!(off <= 1e-9)) return wrong() << "a vertex is off the manifold by " << off;
  Eigen::MatrixXd barycentres = Eigen::MatrixXd::Zero(mesh.points.rows(), mesh.simplices.cols());
  for (Eigen::Index j = 0; j < mesh.simplices.cols(); ++j) {
    for (Eigen::Index i = 0; i < mesh.simplices.rows(); ++i) {
      barycentres.col(j) += mesh.points.col(mesh.simplices(i, j));
    }
  }
  barycentres /= static_cast<double>(mesh.simplices.rows());
  const double farthest = manifold.Distance(barycentres).maxCoeff();
  if (!(farthest <= epsilon)) return wrong() << "a barycentre is " << farthest << " away";
  return ::testing::AssertionSuccess();
}

}  // namespace stellate::testing
