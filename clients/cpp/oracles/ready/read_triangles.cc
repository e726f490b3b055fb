// The one file that includes CGAL, whose readers take seconds to compile.
#include <CGAL/IO/polygon_soup_io.h>
#include <CGAL/Simple_cartesian.h>

#include <exception>
#include <vector>

#include "oracles/ready/common.h"
#include "stellate/oracles/points.h"

namespace stellate::oracles {

Triangles ReadTriangles(const std::string& path) {
  const std::string begin = "'" + path + "' cannot be read as a mesh: ";
  std::vector<CGAL::Simple_cartesian<double>::Point_3> points;
  std::vector<std::vector<size_t>> polygons;
  bool read = false;
  try {
    read = CGAL::IO::read_polygon_soup(path, points, polygons);
  } catch (const std::exception& e) {
    Refuse(begin + e.what());
  }
  if (!read) Refuse(begin + "it is not there, or no whole .off, .obj, .stl or .ply");
  Triangles triangles{Eigen::MatrixXd(3, std::ssize(points)), {}};
  for (Eigen::Index j = 0; j < triangles.points.cols(); ++j) {
    const auto& point = points[static_cast<size_t>(j)];
    triangles.points.col(j) << point.x(), point.y(), point.z();
  }
  std::vector<int> corners;
  for (const std::vector<size_t>& polygon : polygons) {
    for (size_t i = 2; i < polygon.size(); ++i) {
      for (const size_t corner : {polygon[0], polygon[i - 1], polygon[i]}) {
        if (corner >= points.size()) Refuse(begin + "a polygon names a point that is not there");
        corners.push_back(static_cast<int>(corner));
      }
    }
  }
  if (corners.empty()) Refuse("'" + path + "' has no triangles");
  triangles.corners = Eigen::Map<const Eigen::MatrixXi>(corners.data(), 3, std::ssize(corners) / 3);
  return triangles;
}

}  // namespace stellate::oracles
