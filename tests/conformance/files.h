#pragma once

#include <google/protobuf/struct.pb.h>

#include <filesystem>
#include <string>
#include <vector>

#include "stellate/mesh.h"
#include "stellate/v1/stellate.pb.h"

namespace stellate::testing {

// The files of this folder; README.md says what they are. A file that cannot be read is thrown.
std::filesystem::path FolderOfFiles();
std::string ReadBytes(const std::filesystem::path& path);
google::protobuf::Value ReadJson(const std::string& name);
std::vector<v1::WatchMeshResponse> ReadStream(const std::string& path);
Mesh ReadTxt(const std::string& path);

// An entry of a JSON object; empty, 0 or an empty list where it has none.
using Entry = google::protobuf::Value;
const Entry& At(const Entry& object, const std::string& key);
std::string TextAt(const Entry& object, const std::string& key);
std::uint64_t NumberAt(const Entry& object, const std::string& key);
std::vector<Entry> ListAt(const Entry& object, const std::string& key);
std::vector<Entry> ListOf(const std::string& name);  // a file that is a list

}  // namespace stellate::testing
