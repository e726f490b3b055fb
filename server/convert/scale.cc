#include "server/convert/scale.h"

#include <charconv>
#include <string_view>

#include "core/base/name_point.h"

namespace stellate::server {
namespace {

using Eigen::Index, Eigen::VectorXd;

// Takes a point from the front of a text. `form` is how 0 is written, not always with all its
// coordinates; those that are not written are 0.
bool TakePoint(std::string_view* text, std::string_view form, VectorXd* point) {
  point->setZero();
  Index i = 0;
  const char* at = text->data();
  const char* const end = at + text->size();
  for (const char c : form) {
    if (c == '0') {
      const auto [after, error] = std::from_chars(at, end, (*point)[i++]);
      if (error != std::errc()) return false;
      at = after;
    } else if (at == end || *at++ != c) {
      return false;
    }
  }
  text->remove_prefix(static_cast<std::size_t>(at - text->data()));
  return true;
}

}  // namespace

void ToOwnCoordinates(const VectorXd& scale, std::vector<double>* points) {
  if (scale.size() == 0) return;
  const auto n = static_cast<Index>(points->size()) / scale.size();
  Eigen::Map<Eigen::MatrixXd>(points->data(), scale.size(), n).array().colwise() *= scale.array();
}

std::string InOwnCoordinates(const VectorXd& scale, const std::string& words) {
  if (scale.size() == 0) return words;
  VectorXd point = VectorXd::Zero(scale.size());
  const std::string form = core::NamePoint(point);
  std::string own;
  for (std::string_view rest = words; !rest.empty();) {
    if (TakePoint(&rest, form, &point)) {
      own += core::NamePoint(point.cwiseProduct(scale));
    } else {
      own += rest.front();
      rest.remove_prefix(1);
    }
  }
  return own;
}

void ToOwnCoordinates(const VectorXd& scale, v1::Certificate* certificate) {
  if (scale.size() == 0) return;
  certificate->set_verdict(InOwnCoordinates(scale, certificate->verdict()));
  for (std::string& warning : *certificate->mutable_warnings())
    warning = InOwnCoordinates(scale, warning);
  if (!certificate->has_sharpest()) return;
  auto& point = *certificate->mutable_sharpest()->mutable_point();
  for (int i = 0; i < point.size(); ++i) point[i] *= scale[i];
}

}  // namespace stellate::server
