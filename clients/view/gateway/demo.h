#pragma once

#include <functional>
#include <memory>
#include <stop_token>
#include <string>

#include "stellate/client.h"
#include "stellate/error.h"

namespace stellate::view {

// A private server that meshes the catalogue, one manifold after the other, for people to look on.
class Demo {
 public:
  static Expected<std::unique_ptr<Demo>> Start();
  ~Demo();

  const std::string& server() const;
  // Meshes until all are done, or stop is requested. `on_mesh` hears of each as it begins.
  Expected<void> Run(const std::stop_token& stop,
                     const std::function<void(const std::string& manifold)>& on_mesh);

 private:
  class Impl;
  explicit Demo(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace stellate::view
