#include "files.h"

#include <google/protobuf/util/json_util.h>

#include <cstdlib>
#include <cstring>
#include <fstream>
#include <iterator>
#include <sstream>
#include <stdexcept>

namespace stellate::testing {

std::filesystem::path FolderOfFiles() { return STELLATE_CONFORMANCE; }

std::string ReadBytes(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  if (!file) throw std::runtime_error("cannot read " + path.string());
  return {std::istreambuf_iterator<char>(file), {}};
}

google::protobuf::Value ReadJson(const std::string& name) {
  google::protobuf::Value value;
  const auto status =
      google::protobuf::util::JsonStringToMessage(ReadBytes(FolderOfFiles() / name), &value);
  if (!status.ok()) throw std::runtime_error(name + ": " + status.ToString());
  return value;
}

std::vector<v1::WatchMeshResponse> ReadStream(const std::string& path) {
  const std::string bytes = ReadBytes(FolderOfFiles() / path);
  std::vector<v1::WatchMeshResponse> messages;
  for (size_t at = 0; at < bytes.size();) {
    std::uint32_t size = 0;
    if (bytes.size() - at < sizeof size) throw std::runtime_error(path + " is cut");
    std::memcpy(&size, bytes.data() + at, sizeof size);
    at += sizeof size;
    if (bytes.size() - at < size ||
        !messages.emplace_back().ParseFromArray(bytes.data() + at, static_cast<int>(size))) {
      throw std::runtime_error(path + " is no stream");
    }
    at += size;
  }
  return messages;
}

Mesh ReadTxt(const std::string& path) {
  std::istringstream text(ReadBytes(FolderOfFiles() / path));
  Eigen::Index k = 0, d = 0, vertices = 0, simplices = 0;
  text >> k >> d >> vertices >> simplices;
  Mesh mesh{Eigen::MatrixXd(d, vertices), SimplexMatrix(k + 1, simplices), {}};
  std::string word;  // a stream refuses subnormal numbers
  for (double& value : mesh.points.reshaped()) {
    text >> word;
    value = std::strtod(word.c_str(), nullptr);
  }
  for (std::uint32_t& id : mesh.simplices.reshaped()) text >> id;
  if (!text) throw std::runtime_error(path + " is no mesh");
  return mesh;
}

const Entry& At(const Entry& object, const std::string& key) {
  const auto& fields = object.struct_value().fields();
  const auto found = fields.find(key);
  return found == fields.end() ? Entry::default_instance() : found->second;
}

std::string TextAt(const Entry& object, const std::string& key) {
  return At(object, key).string_value();
}

std::uint64_t NumberAt(const Entry& object, const std::string& key) {
  return static_cast<std::uint64_t>(At(object, key).number_value());
}

std::vector<Entry> ListAt(const Entry& object, const std::string& key) {
  const auto& values = At(object, key).list_value().values();
  return {values.begin(), values.end()};
}

std::vector<Entry> ListOf(const std::string& name) {
  const Entry all = ReadJson(name);
  return {all.list_value().values().begin(), all.list_value().values().end()};
}

}  // namespace stellate::testing
