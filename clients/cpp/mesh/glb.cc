// Binary glTF 2.0, what Blender, three.js and browsers show: a node a region, a material a wall.
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "mesh/formats.h"
#include "mesh/json.h"
#include "mesh/parts.h"
#include "mesh/surface.h"
#include "stellate/version.h"

namespace stellate::client {
namespace {

using Eigen::Index;
using Vectors = Eigen::Matrix<float, 3, Eigen::Dynamic>;

enum Target : std::uint64_t {
  kArrayBuffer = 34962,
  kElementArrayBuffer = 34963
};  // of views of the buffer
constexpr std::uint64_t kFloat = 5126, kUnsigned = 5125;

std::string Numbers(const auto& values) {
  std::vector<std::string> numbers;
  numbers.reserve(static_cast<std::size_t>(values.size()));
  for (const double value : values) numbers.push_back(JsonObject::Number(value));
  return JsonList(numbers);
}

// A colour of its own for each, by the golden section around the circle of hues.
std::string Colour(std::size_t number) {
  const double hue = std::fmod(0.58 + 0.618034 * static_cast<double>(number), 1.0);
  constexpr double kSaturation = 0.45, kValue = 0.8;
  std::vector<std::string> channels;
  for (const double first : {5.0, 3.0, 1.0}) {  // red, green, blue, by sixths of the circle
    const double k = std::fmod(first + hue * 6, 6.0);
    const double less = std::clamp(std::min(k, 4 - k), 0.0, 1.0);
    std::array<char, 16> text;
    std::snprintf(text.data(), text.size(), "%.4f", kValue * (1 - kSaturation * less));
    channels.emplace_back(text.data());
  }
  channels.emplace_back("1");
  return JsonList(channels);
}

// Some triangles of a part, with points of their own.
struct Drawing {
  Vectors points, normals;
  std::vector<std::uint32_t> ids;
};

Drawing DrawingOf(const Part& part, const std::vector<Index>& columns) {
  const auto [points, triangles] =
      WithTheirPoints(part.points, part.triangles(Eigen::all, columns));
  Eigen::Matrix3Xd sums = Eigen::Matrix3Xd::Zero(3, points.cols());
  for (const auto& triangle : triangles.colwise()) {
    const Eigen::Vector3d first = points.col(triangle[0]);
    const Eigen::Vector3d second = points.col(triangle[1]);
    const Eigen::Vector3d third = points.col(triangle[2]);
    const Eigen::Vector3d across = (second - first).cross(third - first);
    for (const std::uint32_t id : triangle) sums.col(id) += across;  // by area
  }
  Drawing drawing{
      points.cast<float>(), {}, {triangles.reshaped().begin(), triangles.reshaped().end()}};
  for (Index i = 0; i < sums.cols(); ++i) {
    const double length = sums.col(i).norm();
    if (length > 0)
      sums.col(i) /= length;
    else
      sums.col(i) = Eigen::Vector3d::UnitZ();  // any unit vector
  }
  drawing.normals = sums.cast<float>();
  return drawing;
}

// The file's JSON and its one buffer, as they grow.
class Scene {
 public:
  // A mesh and its node: a primitive for each wall, so that shading is smooth on each, and not
  // across.
  void Add(const Part& part) {
    std::vector<std::string> primitives;
    for (const Part::Patch& patch : part.patches) {
      const Drawing drawing = DrawingOf(part, patch.columns);
      JsonObject attributes, primitive;
      attributes.Add("POSITION", AddVectors(drawing.points, true));
      attributes.Add("NORMAL", AddVectors(drawing.normals, false));
      primitive.Raw("attributes", attributes.Take());
      primitive.Add("indices", AddIds(drawing.ids));
      primitive.Add("material",
                    AddMaterial(part.name + (patch.name.empty() ? "" : "_") + patch.name));
      primitives.push_back(primitive.Take());
    }
    JsonObject node, mesh;
    node.Add("name", part.name);
    node.Add("mesh", std::uint64_t{meshes_.size()});
    // glTF's y is up: a quarter turn brings z there.
    const double half = std::sqrt(0.5);
    node.Raw("rotation", Numbers(std::array{-half, 0.0, 0.0, half}));
    mesh.Add("name", part.name);
    mesh.Raw("primitives", JsonList(primitives));
    numbers_.push_back(std::to_string(nodes_.size()));
    nodes_.push_back(node.Take());
    meshes_.push_back(mesh.Take());
  }

  std::string Document() const {
    JsonObject asset, scene, buffer, document;
    asset.Add("version", std::string("2.0"));
    asset.Add("generator", std::string("stellate " STELLATE_VERSION));
    scene.Raw("nodes", JsonList(numbers_));
    buffer.Add("byteLength", std::uint64_t{buffer_.size()});
    document.Raw("asset", asset.Take());
    document.Add("scene", std::uint64_t{0});
    document.Raw("scenes", JsonList({scene.Take()}));
    document.Raw("nodes", JsonList(nodes_));
    document.Raw("meshes", JsonList(meshes_));
    document.Raw("materials", JsonList(materials_));
    document.Raw("accessors", JsonList(accessors_));
    document.Raw("bufferViews", JsonList(views_));
    document.Raw("buffers", JsonList({buffer.Take()}));
    return document.Take();
  }
  const std::string& buffer() const { return buffer_; }

 private:
  JsonObject Accessor(const void* data, std::size_t bytes, std::size_t count, std::uint64_t kind,
                      Target target) {
    JsonObject view, accessor;
    view.Add("buffer", std::uint64_t{0});
    view.Add("byteOffset", std::uint64_t{buffer_.size()});
    view.Add("byteLength", std::uint64_t{bytes});
    view.Add("target", std::uint64_t{target});
    accessor.Add("bufferView", std::uint64_t{views_.size()});
    accessor.Add("componentType", kind);
    accessor.Add("count", std::uint64_t{count});
    accessor.Add("type", std::string(kind == kFloat ? "VEC3" : "SCALAR"));
    views_.push_back(view.Take());
    buffer_.append(static_cast<const char*>(data), bytes);  // numbers of four bytes each
    return accessor;
  }
  std::uint64_t AddVectors(const Vectors& vectors, bool has_bounds) {
    JsonObject accessor =
        Accessor(vectors.data(), sizeof(float) * static_cast<std::size_t>(vectors.size()),
                 static_cast<std::size_t>(vectors.cols()), kFloat, kArrayBuffer);
    if (has_bounds) {
      accessor.Raw("min", Numbers(Eigen::Vector3f(vectors.rowwise().minCoeff())));
      accessor.Raw("max", Numbers(Eigen::Vector3f(vectors.rowwise().maxCoeff())));
    }
    accessors_.push_back(accessor.Take());
    return accessors_.size() - 1;
  }
  std::uint64_t AddIds(const std::vector<std::uint32_t>& ids) {
    accessors_.push_back(Accessor(ids.data(), sizeof(std::uint32_t) * ids.size(), ids.size(),
                                  kUnsigned, kElementArrayBuffer)
                             .Take());
    return accessors_.size() - 1;
  }
  std::uint64_t AddMaterial(const std::string& name) {
    JsonObject look, material;
    look.Raw("baseColorFactor", Colour(materials_.size()));
    look.Add("metallicFactor", 0.0);
    look.Add("roughnessFactor", 0.6);
    material.Add("name", name);
    material.Raw("pbrMetallicRoughness", look.Take());
    material.Add("doubleSided", true);
    materials_.push_back(material.Take());
    return materials_.size() - 1;
  }

  std::string buffer_;
  std::vector<std::string> numbers_, nodes_, meshes_, materials_, accessors_, views_;
};

void AddUint32(std::string* bytes, std::uint64_t number) {
  const auto single = static_cast<std::uint32_t>(number);
  bytes->append(reinterpret_cast<const char*>(&single), sizeof single);
}

}  // namespace

Expected<std::string> Glb(const Mesh& mesh) {
  const auto parts = PartsOf(mesh, ".glb");
  if (!parts) return tl::unexpected(parts.error());
  Scene scene;
  for (const Part& part : *parts) {
    if (auto ok = CheckSinglePrecision(part.points, part.triangles, ".glb"); !ok)
      return tl::unexpected(ok.error());
    scene.Add(part);
  }
  std::string text = scene.Document();
  while (text.size() % 4 != 0) text += ' ';
  const std::string& body = scene.buffer();
  const std::uint64_t size = 12 + 8 + text.size() + 8 + body.size();
  if (size > std::numeric_limits<std::uint32_t>::max()) {
    return Fail(ErrorCode::kFileFailed,
                ".glb holds 4 GiB, and this mesh takes " + std::to_string(size) + " bytes");
  }
  std::string bytes = "glTF";
  AddUint32(&bytes, 2);
  AddUint32(&bytes, size);
  AddUint32(&bytes, text.size());
  bytes += "JSON" + text;
  AddUint32(&bytes, body.size());
  bytes.append("BIN\0", 4);
  return bytes + body;
}

}  // namespace stellate::client
