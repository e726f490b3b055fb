// Meshes the surface near points of space on a stellated of its own. The points are the lines of a
// file, three numbers each.
//
//   mesh_of_points points.txt mesh.ply
#include <cstdlib>
#include <fstream>
#include <iostream>
#include <iterator>
#include <vector>

#include "stellate/oracles.h"
#include "stellate/stellate.h"

int main(int argc, char** argv) {
  if (argc < 3) {
    std::cerr << "name the file of points, and the file to write\n";
    return EXIT_FAILURE;
  }
  std::ifstream file(argv[1]);
  const std::vector<double> numbers{std::istream_iterator<double>(file), {}};
  const Eigen::Map<const Eigen::Matrix3Xd> points(numbers.data(), 3,
                                                  static_cast<Eigen::Index>(numbers.size()) / 3);
  stellate::oracles::PointCloud cloud(points, /*dimension=*/2);
  std::cout << cloud.about() << "\n";

  stellate::MeshOptions options;
  options.epsilon = 2 * cloud.bandwidth();
  const auto mesh = stellate::MeshManifold(cloud, options);
  if (!mesh) {
    std::cerr << mesh.error().message << "\n";
    return EXIT_FAILURE;
  }
  std::cout << mesh->report.text;
  if (const auto saved = mesh->Save(argv[2]); !saved) {
    std::cerr << saved.error().message << "\n";
    return EXIT_FAILURE;
  }
  return mesh->report.certified() ? EXIT_SUCCESS : EXIT_FAILURE;
}
