#include "run/scaled.h"

#include <stdexcept>

#include "stellate/oracles/combined.h"

namespace stellate::client {

Expected<std::shared_ptr<Oracle>> Scaled(Oracle& oracle, const MeshOptions& options) {
  std::shared_ptr<Oracle> own(std::shared_ptr<void>(), &oracle);  // which is the caller's
  if (options.scale.empty()) return own;
  const auto axes = static_cast<Eigen::Index>(options.scale.size());
  try {
    return std::make_shared<oracles::InUnits>(
        own, Eigen::Map<const Eigen::VectorXd>(options.scale.data(), axes));
  } catch (const std::invalid_argument& refusal) {
    return Fail(ErrorCode::kRefused, refusal.what());
  }
}

}  // namespace stellate::client
