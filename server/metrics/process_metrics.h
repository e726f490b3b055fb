#pragma once

#include <prometheus/collectable.h>

namespace stellate::server {

// The system's figures of this process, under the names that Prometheus's own libraries use, and
// stellate_build_info. Figures that the system does not have are left out.
class ProcessMetrics final : public prometheus::Collectable {
 public:
  std::vector<prometheus::MetricFamily> Collect() const override;
};

}  // namespace stellate::server
