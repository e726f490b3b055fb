#pragma once

#include <algorithm>
#include <cstdint>
#include <map>
#include <set>
#include <vector>

namespace stellate::testing {

// A simplicial complex by its simplices of the highest dimension, ascending vertex ids each.
using Complex = std::set<std::vector<std::uint32_t>>;

// All faces of a complex, by dimension.
inline std::vector<Complex> FacesOf(const Complex& simplices) {
  std::vector<Complex> faces;
  for (const auto& s : simplices) {
    if (faces.size() < s.size()) faces.resize(s.size());
    for (unsigned mask = 1; mask < 1u << s.size(); ++mask) {
      std::vector<std::uint32_t> face;
      for (std::size_t i = 0; i < s.size(); ++i)
        if (mask >> i & 1u) face.push_back(s[i]);
      faces[face.size() - 1].insert(std::move(face));
    }
  }
  return faces;
}

inline std::int64_t EulerOf(const Complex& simplices) {
  std::int64_t sum = 0, sign = 1;
  for (const Complex& some : FacesOf(simplices)) {
    sum += sign * static_cast<std::int64_t>(some.size());
    sign = -sign;
  }
  return sum;
}

// The ranks of its homology over Z/2, by dimension: columns of the boundary matrices are reduced
// one by one, those of the highest dimension first, whose lowest rows need no column of their own.
inline std::vector<int> BettiNumbers(const Complex& simplices) {
  const std::vector<Complex> faces = FacesOf(simplices);
  std::vector<int> betti;
  for (const Complex& some : faces) betti.push_back(static_cast<int>(some.size()));
  std::set<int> cleared;
  for (std::size_t j = faces.size(); j-- > 1;) {
    std::map<std::vector<std::uint32_t>, int> row;
    for (const auto& face : faces[j - 1]) row.emplace(face, static_cast<int>(row.size()));
    std::vector<std::vector<int>> by_lowest(row.size());
    std::set<int> lowest;
    int number = 0;
    for (const auto& s : faces[j]) {
      if (cleared.count(number++) > 0) continue;
      std::vector<int> column;
      for (std::size_t i = 0; i < s.size(); ++i) {
        std::vector<std::uint32_t> facet = s;
        facet.erase(facet.begin() + static_cast<std::ptrdiff_t>(i));
        column.push_back(row.at(facet));
      }
      std::sort(column.begin(), column.end());
      while (!column.empty() && !by_lowest[static_cast<std::size_t>(column.back())].empty()) {
        const auto& other = by_lowest[static_cast<std::size_t>(column.back())];
        std::vector<int> sum;
        std::set_symmetric_difference(column.begin(), column.end(), other.begin(), other.end(),
                                      std::back_inserter(sum));
        column = std::move(sum);
      }
      if (column.empty()) continue;
      lowest.insert(column.back());
      by_lowest[static_cast<std::size_t>(column.back())] = std::move(column);
    }
    betti[j] -= static_cast<int>(lowest.size());
    betti[j - 1] -= static_cast<int>(lowest.size());
    cleared = std::move(lowest);
  }
  return betti;
}

// The facets that are in one simplex, or in more than two.
inline Complex RimOf(const Complex& simplices) {
  std::map<std::vector<std::uint32_t>, int> facets;
  for (const auto& s : simplices)
    for (std::size_t i = 0; i < s.size(); ++i) {
      std::vector<std::uint32_t> facet = s;
      facet.erase(facet.begin() + static_cast<std::ptrdiff_t>(i));
      ++facets[facet];
    }
  Complex rim;
  for (const auto& [facet, count] : facets)
    if (count != 2) rim.insert(facet);
  return rim;
}

}  // namespace stellate::testing
