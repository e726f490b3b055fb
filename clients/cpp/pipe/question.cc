#include "pipe/framing.h"
#include "pipe/numbers.h"

namespace stellate::pipe {
namespace {

void AppendRaw(const void* data, size_t bytes, std::string* to) {
  to->append(static_cast<const char*>(data), bytes);
}

// Columns of an Eigen matrix are the rows of the wire.
void AppendNumbers(const Eigen::Ref<const Eigen::MatrixXd>& numbers, std::string* to) {
  AppendRaw(numbers.data(), sizeof(double) * static_cast<size_t>(numbers.size()), to);
}

std::string Binary(const Question& question) {
  const std::uint32_t head[] = {question.bases != nullptr ? 2u : 1u,
                                static_cast<std::uint32_t>(question.points.cols()),
                                (question.tangents ? 1u : 0u) | (question.sizes ? 2u : 0u), 0};
  std::string bytes;
  const Eigen::Index flat = question.bases != nullptr ? question.bases->rows() + 1 : 0;
  bytes.reserve(sizeof head +
                sizeof(double) *
                    static_cast<size_t>(question.points.cols() * (question.points.rows() + flat)));
  AppendRaw(head, sizeof head, &bytes);
  AppendNumbers(question.points, &bytes);
  if (question.bases != nullptr) {
    AppendNumbers(*question.bases, &bytes);
    AppendNumbers(*question.radii, &bytes);
  }
  return bytes;
}

template <typename Numbers>
void AppendWords(const Numbers& numbers, std::string* to) {
  for (const double number : numbers) {
    AppendNumber(number, to);
    *to += ' ';
  }
}

std::string Text(const Question& question) {
  std::string bytes = question.bases != nullptr ? "flat " : "closest ";
  bytes += std::to_string(question.points.cols());
  bytes += question.tangents ? " 1" : " 0";
  bytes += question.sizes ? " 1\n" : " 0\n";
  for (Eigen::Index j = 0; j < question.points.cols(); ++j) {
    AppendWords(question.points.col(j), &bytes);
    if (question.bases != nullptr) {
      AppendWords(question.bases->col(j), &bytes);
      AppendNumber((*question.radii)[j], &bytes);
      bytes += ' ';
    }
    bytes.back() = '\n';
  }
  return bytes;
}

}  // namespace

std::string ToBytes(const Question& question, bool text) {
  return text ? Text(question) : Binary(question);
}

}  // namespace stellate::pipe
