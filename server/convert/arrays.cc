#include "server/convert/arrays.h"

#include <algorithm>
#include <bit>
#include <cstring>

#include "core/base/message.h"

namespace stellate::server {

// The wire's order is this machine's, so memory is copied as it is.
static_assert(std::endian::native == std::endian::little);

std::string ShapeText(const google::protobuf::RepeatedField<std::uint32_t>& shape) {
  constexpr int kShown = 8;  // axes; a hostile shape may have any number
  std::string text = "[";
  for (int i = 0; i < std::min(shape.size(), kShown); ++i) {
    text += (i > 0 ? ", " : "") + std::to_string(shape[i]);
  }
  return text + (shape.size() > kShown ? ", ...]" : "]");
}

core::Status CheckArray(const v1::Array& array, std::initializer_list<std::uint64_t> shape,
                        const std::string& name, core::StatusCode code) {
  google::protobuf::RepeatedField<std::uint32_t> wanted;
  for (const std::uint64_t extent : shape) wanted.Add(static_cast<std::uint32_t>(extent));
  const bool same =
      std::equal(array.shape().begin(), array.shape().end(), wanted.begin(), wanted.end());
  if (!same) {
    return {code,
            core::Message(name, " has the shape ", ShapeText(array.shape()), " but needs ",
                          ShapeText(wanted), ": send an array of float64 of that shape"),
            name};
  }
  std::uint64_t bytes = sizeof(double);
  for (const std::uint64_t extent : shape) bytes *= extent;
  if (array.data().size() != bytes) {
    return {code,
            core::Message(name, " has ", array.data().size(), " bytes but its shape ",
                          ShapeText(wanted), " needs ", bytes,
                          ": send little-endian float64 in C order"),
            name};
  }
  return core::Status::Ok();
}

Eigen::MatrixXd MatrixFromProto(const v1::Array& array, Eigen::Index rows, Eigen::Index columns) {
  Eigen::MatrixXd matrix(rows, columns);
  if (matrix.size() > 0) {
    std::memcpy(matrix.data(), array.data().data(), sizeof(double) * matrix.size());
  }
  return matrix;
}

void ToProto(const double* data, std::initializer_list<std::size_t> shape, v1::Array* array) {
  array->Clear();
  std::size_t count = 1;
  for (const std::size_t extent : shape) {
    array->add_shape(static_cast<std::uint32_t>(extent));
    count *= extent;
  }
  array->mutable_data()->assign(reinterpret_cast<const char*>(data), count * sizeof(double));
}

void ToProto(const std::vector<std::uint32_t>& data, std::size_t row_size, v1::IndexArray* array) {
  array->Clear();
  array->add_shape(static_cast<std::uint32_t>(data.size() / row_size));
  array->add_shape(static_cast<std::uint32_t>(row_size));
  array->mutable_data()->assign(reinterpret_cast<const char*>(data.data()),
                                data.size() * sizeof(std::uint32_t));
}

}  // namespace stellate::server
