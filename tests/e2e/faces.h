#pragma once

#include <gtest/gtest.h>

#include <cstddef>
#include <cstdint>
#include <map>
#include <set>
#include <vector>

#include "stellate/mesh.h"

// What a complex and its faces are, counted from the simplices alone.
namespace stellate::testing {

using Ids = std::vector<std::uint32_t>;

inline std::vector<Ids> Columns(const SimplexMatrix& simplices) {
  std::vector<Ids> columns;
  for (const auto& simplex : simplices.colwise())
    columns.emplace_back(simplex.begin(), simplex.end());
  return columns;
}

// Of a complex, all its faces counted.
inline int Euler(const SimplexMatrix& simplices) {
  std::set<Ids> faces;
  for (const Ids& simplex : Columns(simplices)) {
    for (unsigned pick = 1; pick < 1u << simplex.size(); ++pick) {
      Ids face;
      for (size_t i = 0; i < simplex.size(); ++i) {
        if (pick >> i & 1) face.push_back(simplex[i]);
      }
      faces.insert(face);
    }
  }
  int chi = 0;
  for (const Ids& face : faces) chi += face.size() % 2 == 1 ? 1 : -1;
  return chi;
}

// The facets in one simplex alone.
inline std::set<Ids> Rim(const SimplexMatrix& simplices) {
  std::map<Ids, int> counts;
  for (const Ids& simplex : Columns(simplices)) {
    for (size_t out = 0; out < simplex.size(); ++out) {
      Ids facet = simplex;
      facet.erase(facet.begin() + static_cast<std::ptrdiff_t>(out));
      ++counts[facet];
    }
  }
  std::set<Ids> rim;
  for (const auto& [facet, count] : counts) {
    EXPECT_LE(count, 2);
    if (count == 1) rim.insert(facet);
  }
  return rim;
}

inline std::set<Ids> All(const std::vector<Face>& faces) {
  std::set<Ids> all;
  for (const Face& face : faces) {
    for (const Ids& simplex : Columns(face.simplices)) {
      EXPECT_TRUE(all.insert(simplex).second) << "in two faces";
    }
  }
  return all;
}

inline size_t Count(const std::vector<Face>& faces) { return All(faces).size(); }

}  // namespace stellate::testing
