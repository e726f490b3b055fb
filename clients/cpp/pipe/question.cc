#include <vector>

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
  std::vector<std::uint32_t> head = {question.bases != nullptr ? 2u : 1u,
                                     static_cast<std::uint32_t>(question.points.cols()),
                                     (question.tangents ? 1u : 0u) | (question.sizes ? 2u : 0u),
                                     static_cast<std::uint32_t>(question.face.size())};
  if (!question.face.empty()) head[0] = 3;
  head.insert(head.end(), question.face.begin(), question.face.end());
  const size_t head_bytes = sizeof(std::uint32_t) * head.size();
  std::string bytes;
  const Eigen::Index flat = question.bases != nullptr ? question.bases->rows() + 1 : 0;
  bytes.reserve(head_bytes + sizeof(double) * static_cast<size_t>(question.points.cols() *
                                                                  (question.points.rows() + flat)));
  AppendRaw(head.data(), head_bytes, &bytes);
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
  std::string bytes = !question.face.empty()      ? "face "
                      : question.bases != nullptr ? "flat "
                                                  : "closest ";
  bytes += std::to_string(question.points.cols());
  bytes += question.tangents ? " 1" : " 0";
  bytes += question.sizes ? " 1" : " 0";
  for (const int wall : question.face) {
    bytes += ' ';
    bytes += std::to_string(wall);
  }
  bytes += '\n';
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
