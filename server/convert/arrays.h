#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <initializer_list>
#include <string>
#include <vector>

#include "core/status.h"
#include "stellate/v1/geometry.pb.h"

namespace stellate::server {

// Arrays on the wire are little-endian in C order. An [n, d, k] array is a (d k) x n matrix here,
// one column for each of the n, so both conversions copy memory.

// "[3, 2]".
std::string ShapeText(const google::protobuf::RepeatedField<std::uint32_t>& shape);

// Ok if `array` has exactly this shape and its number of bytes; else `code`, with a message that
// says what was received and expected, and starts with `name`, the field.
core::Status CheckArray(const v1::Array& array, std::initializer_list<std::uint64_t> shape,
                        const std::string& name, core::StatusCode code);

// Column j is the j-th of the first axis. The shape [n, rows...] must have been checked.
Eigen::MatrixXd MatrixFromProto(const v1::Array& array, Eigen::Index rows, Eigen::Index columns);

void ToProto(const double* data, std::initializer_list<std::size_t> shape, v1::Array* array);
// Rows of `row_size` indices.
void ToProto(const std::vector<std::uint32_t>& data, std::size_t row_size, v1::IndexArray* array);

}  // namespace stellate::server
