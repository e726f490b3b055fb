#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "stellate/v1/mesh.pb.h"

namespace stellate::server {

// Axes of different units: a mesh is made in y = x / scale, and delivered in x. `scale` has d
// lengths, or none, which changes nothing.

// Of points, one after the other.
void ToOwnCoordinates(const Eigen::VectorXd& scale, std::vector<double>* points);
// Of places in words of the server's, as core::NamePoint writes them.
std::string InOwnCoordinates(const Eigen::VectorXd& scale, const std::string& words);
// Of all places in a certificate.
void ToOwnCoordinates(const Eigen::VectorXd& scale, v1::Certificate* certificate);

}  // namespace stellate::server
