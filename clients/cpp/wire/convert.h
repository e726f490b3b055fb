#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <vector>

#include "stellate/client.h"
#include "stellate/monitor.h"
#include "stellate/v1/geometry.pb.h"
#include "stellate/v1/mesh.pb.h"
#include "stellate/v1/stellate.pb.h"

// Between the client's types and the wire's. Nothing here trusts the server: what does not fit
// is an error, never a crash.
namespace stellate::client {

// A matrix column holds one query's or point's numbers, as an array's row does on the wire: with
// `shape` the extents after the first, the bytes are the same.
void ToArray(const Eigen::MatrixXd& columns, const std::vector<std::uint32_t>& shape,
             v1::Array* array);
Expected<Eigen::MatrixXd> FromArray(const v1::Array& array,
                                    const std::vector<std::uint32_t>& shape);
// As FromArray, at the end of `numbers`.
Expected<void> AppendNumbers(const v1::Array& array, const std::vector<std::uint32_t>& shape,
                             std::vector<double>* numbers);
// The rows of an [n, width] array, which has what they need.
Expected<Eigen::Index> CountRows(const v1::IndexArray& array, std::uint32_t width);

// Errors: dimensions or a chunk size with which no worker can be.
Expected<void> CheckServable(const Oracle& oracle, std::optional<std::uint32_t> max_chunk);
// Errors: an option that the wire cannot carry (the server checks the rest).
Expected<v1::MeshSpec> ToSpec(Oracle& oracle, const MeshOptions& options);

// Returns the dimension of a mesh's simplices.
inline int SimplexDimension(const v1::MeshSpec& spec) {
  return static_cast<int>(spec.dimension()) - (spec.boundary_only() ? 1 : 0);
}

Progress FromProto(const v1::Progress& message);
Report ReportOf(const v1::Mesh& mesh);
MeshState FromProto(v1::MeshState state);
MeshStatus StatusOf(const v1::Mesh& mesh);
ServerHealth HealthOf(const v1::ServerInfo& info);  // all but whether it serves

}  // namespace stellate::client
