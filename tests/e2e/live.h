#pragma once

#include <gtest/gtest.h>

#include <memory>
#include <optional>
#include <string>

#include "net/embedded_server.h"
#include "stellate/client.h"
#include "stellate/doctor.h"
#include "support/make_manifold.h"

namespace stellate::testing {

// One real stellated for all tests of a program, so that each finds it as the others left it.
class Live : public ::testing::Test {
 protected:
  static const std::string& Server() {
    static const std::unique_ptr<client::EmbeddedServer> server = [] {
      auto started = client::EmbeddedServer::Start();
      if (!started) ADD_FAILURE() << started.error().message;
      return started ? std::move(*started) : nullptr;
    }();
    static const std::string address = server ? server->address() : "unix:/nowhere";
    return address;
  }

  static MeshOptions At(double epsilon) {
    MeshOptions options;
    options.epsilon = epsilon;
    options.connection.server = Server();
    return options;
  }

  static CheckReport Examined(Oracle& oracle, std::optional<double> epsilon = {}) {
    CheckOptions options;
    options.epsilon = epsilon;
    options.connection.server = Server();
    const Expected<CheckReport> report = Check(oracle, options);
    if (!report) ADD_FAILURE() << report.error().message;
    return report.value_or(CheckReport());
  }
};

// Same points, bit for bit, and same simplices.
inline ::testing::AssertionResult AreIdentical(const Mesh& a, const Mesh& b) {
  if (a.points.rows() != b.points.rows() || a.points.cols() != b.points.cols() ||
      a.points != b.points) {
    return ::testing::AssertionFailure() << "points differ";
  }
  if (a.simplices.cols() != b.simplices.cols() || a.simplices != b.simplices) {
    return ::testing::AssertionFailure() << "simplices differ";
  }
  return ::testing::AssertionSuccess();
}

}  // namespace stellate::testing
