#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/batch.h"
#include "core/complex/star_complex.h"

namespace stellate::core {

// What M looks like between the sample points, guessed at no query cost: at each point p a quadric
//
//   y(u) = p + T_p u + II_p(u, u) / 2,   u in R^K,
//
// fitted to its neighbours in the star, and blended between the nearest. Good enough to plan by,
// never to mesh by: what is planned on it is asked for before it is inserted.
template <int K>
class Surrogate {
 public:
  // Fits the bounded stars of `complex`, which is borrowed and must not change.
  explicit Surrogate(const StarComplex<K>& complex);

  // The point of the guessed M near x and its tangent basis (K rows of d). False where the quadrics
  // of the nearest points disagree, or where there are none.
  bool Predict(const double* x, double* point, double* tangent) const;

  // Answers closest-point queries, with tangents; not found where Predict refuses. In parallel.
  AnswerBlock Answer(const QueryBlock& block) const;

 private:
  static constexpr int kTerms = K * (K + 1) / 2;

  void Fit(std::uint32_t p);
  const double* Form(std::uint32_t p) const { return forms_.data() + p * form_size_; }

  const StarComplex<K>& complex_;
  std::size_t form_size_;
  std::vector<double> forms_;         // by point: II(e_a, e_b), a <= b, d each
  std::vector<std::uint8_t> fitted_;  // by point
};

extern template class Surrogate<1>;
extern template class Surrogate<2>;
extern template class Surrogate<3>;
extern template class Surrogate<4>;
extern template class Surrogate<5>;

}  // namespace stellate::core
