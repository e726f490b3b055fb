#pragma once

#include <Eigen/Core>
#include <string>
#include <string_view>
#include <vector>

#include "stellate/oracles/points.h"

// Files of polygons, as bytes from anywhere: whatever they say, they are refused with the place and
// the cause, or make triangles that name points that are there. Memory stays within a multiple of
// the bytes given: no count is believed beyond what the bytes that follow can hold. All throw
// std::invalid_argument.
namespace stellate::oracles::files {

Triangles ParseObj(std::string_view bytes);
Triangles ParseOff(std::string_view bytes);  // as text
Triangles ParsePly(std::string_view bytes);  // as text, or binary of either byte order
Triangles ParseStl(std::string_view bytes);  // as text, or binary; equal corners become one point

// d x n. Refused where a number is not finite, or a point has fewer or more than others.
Eigen::MatrixXd ParsePlyPoints(std::string_view bytes);  // of the vertices; d is 3
Eigen::MatrixXd ParseNpy(std::string_view bytes);
// `all`: also columns that have other titles than x, y and z, which these are among.
Eigen::MatrixXd ParsePointText(std::string text, bool all);
// The columns with these titles, or numbers from 1, in this order.
Eigen::MatrixXd ParsePointColumns(std::string_view text, const std::vector<std::string>& columns);

struct Format {
  const char* ending;
  Triangles (*parse)(std::string_view bytes);
};
inline constexpr Format kFormats[] = {
    {".off", ParseOff}, {".ply", ParsePly}, {".stl", ParseStl}, {".obj", ParseObj}};

}  // namespace stellate::oracles::files
