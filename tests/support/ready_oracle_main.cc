// ready_oracle NAME: a ready oracle of C++ through the pipe (docs/using/pipe.md), so that tests in
// other languages can ask it.
#include <cstdint>
#include <cstdio>
#include <exception>
#include <string>

#include "support/ready_oracles.h"

namespace {

using stellate::Answer;
using stellate::Oracle;

std::string Numbers(const Eigen::VectorXd& numbers, const char* separator) {
  std::string text;
  for (const double number : numbers) {
    char digits[32];
    std::snprintf(digits, sizeof digits, "%s%.17g", text.empty() ? "" : separator, number);
    text += digits;
  }
  return text;
}

void Greet(const Oracle& oracle) {
  std::printf("stellate-oracle 1 binary k=%d d=%d tangents=%d flats=%d sizes=%d",
              oracle.dimension(), oracle.ambient_dimension(), oracle.has_tangent_basis() ? 1 : 0,
              oracle.has_intersect_flat() ? 1 : 0, oracle.has_local_size() ? 1 : 0);
  if (const auto box = oracle.bounding_box()) {
    std::printf(" box=%s:%s", Numbers(box->lower, ",").c_str(), Numbers(box->upper, ",").c_str());
  }
  std::printf("\n");
  std::fflush(stdout);
}

template <typename Matrix>
bool Read(Matrix* numbers) {
  const auto count = static_cast<size_t>(numbers->size());
  return std::fread(numbers->data(), sizeof(double), count, stdin) == count;
}

template <typename Matrix>
void Write(const Matrix& numbers) {
  std::fwrite(numbers.data(), sizeof *numbers.data(), static_cast<size_t>(numbers.size()), stdout);
}

// False at the end of the input.
bool AnswerBatch(Oracle* oracle) {
  std::uint32_t head[4];
  if (std::fread(head, sizeof head, 1, stdin) != 1) return false;
  const int k = oracle->dimension(), d = oracle->ambient_dimension();
  Eigen::MatrixXd x(d, head[1]), bases(d * k, head[1]);
  Eigen::VectorXd radii(head[1]);
  if (!Read(&x)) return false;
  if (head[0] == 2 && (!Read(&bases) || !Read(&radii))) return false;
  const Answer answer =
      head[0] == 2 ? oracle->IntersectFlat(x, bases, radii) : oracle->ClosestPoint(x);
  Eigen::Matrix<std::uint8_t, Eigen::Dynamic, 1> found(x.cols());
  for (Eigen::Index j = 0; j < x.cols(); ++j) found[j] = answer.IsFound(j) ? 1 : 0;
  const std::uint32_t flags[] = {head[1], head[2] | 4};
  std::fwrite(flags, sizeof flags, 1, stdout);
  Write(answer.points);
  if ((head[2] & 1) != 0) Write(oracle->TangentBasis(answer.points));
  if ((head[2] & 2) != 0) Write(oracle->LocalSize(answer.points));
  Write(found);
  std::fflush(stdout);
  return true;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    const auto oracle = stellate::testing::MakeReadyOracle(argc > 1 ? argv[1] : "");
    Greet(*oracle);
    while (AnswerBatch(oracle.get())) {
    }
    return 0;
  } catch (const std::exception& e) {
    std::fprintf(stderr, "%s\n", e.what());
    return 1;
  }
}
