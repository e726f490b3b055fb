#pragma once

#include <prometheus/collectable.h>

namespace stellate::server {

// What the system says of this process, under the names that Prometheus's own libraries give it,
// and stellate_build_info. What the system does not say is left out.
class ProcessMetrics final : public prometheus::Collectable {
 public:
  std::vector<prometheus::MetricFamily> Collect() const override;
};

}  // namespace stellate::server
