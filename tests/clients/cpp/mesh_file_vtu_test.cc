#include <gtest/gtest.h>

#include <cstdint>
#include <cstring>
#include <string>
#include <vector>

#include "mesh_file_fixture.h"
#include "stellate/mesh.h"

namespace stellate {
namespace {

// The byte count and the bytes of a VTU data array that is inline, from base64.
std::string InlineBytes(const std::string& xml, size_t array) {
  const size_t start = xml.find('>', array) + 1;
  std::string bytes;
  std::uint32_t bits = 0;
  int held = 0;
  for (const char c : xml.substr(start, xml.find('<', start) - start)) {
    if (c == '=') break;
    const int digit = c >= 'a'   ? c - 'a' + 26
                      : c >= 'A' ? c - 'A'
                      : c == '+' ? 62
                      : c == '/' ? 63
                                 : c - '0' + 52;
    bits = bits << 6 | static_cast<std::uint32_t>(digit);
    held += 6;
    if (held >= 8) {
      held -= 8;
      bytes += static_cast<char>(bits >> held & 0xff);
    }
  }
  return bytes;
}

// The same, raw, of one that is among the appended data, with what follows it.
std::string AppendedBytes(const std::string& xml, const std::string& tag, size_t unit) {
  const size_t data = xml.find('_', xml.find("<AppendedData encoding=\"raw\">")) + 1;
  const std::string offset = "offset=\"";
  const size_t place = std::stoul(tag.substr(tag.find(offset) + offset.size()));
  EXPECT_EQ((data + place) % unit, 0u) << "can be mapped into memory: " << tag;
  return xml.substr(data + place);
}

// The numbers of a VTU data array.
template <typename Number>
std::vector<Number> VtuNumbers(const std::string& xml, const std::string& name) {
  const size_t array = xml.find("Name=\"" + name + "\"");
  EXPECT_NE(array, std::string::npos) << name;
  if (array == std::string::npos) return {};
  const std::string tag = xml.substr(array, xml.find('>', array) - array);
  const std::string bytes = tag.find("\"appended\"") == std::string::npos
                                ? InlineBytes(xml, array)
                                : AppendedBytes(xml, tag, sizeof(Number));
  std::uint64_t size = 0;
  std::memcpy(&size, bytes.data(), sizeof size);
  EXPECT_GE(bytes.size(), sizeof size + size);
  std::vector<Number> numbers(size / sizeof(Number));
  std::memcpy(numbers.data(), bytes.data() + sizeof size, size);
  return numbers;
}

TEST_F(MeshFile, VtuHoldsPointsAndCells) {
  const Mesh mesh = Surface(3);
  const std::string xml = Saved(mesh, "a.vtu");
  EXPECT_NE(xml.find("NumberOfPoints=\"4\" NumberOfCells=\"4\""), std::string::npos);
  const std::vector<double> points = VtuNumbers<double>(xml, "Points");
  EXPECT_EQ(points, std::vector<double>(mesh.points.data(), mesh.points.data() + 12));
  const auto ids = VtuNumbers<std::int64_t>(xml, "connectivity");
  ASSERT_EQ(ids.size(), 12u);
  std::vector<std::vector<int>> faces;
  for (size_t i = 0; i < 12; i += 3) {
    faces.push_back(
        {static_cast<int>(ids[i]), static_cast<int>(ids[i + 1]), static_cast<int>(ids[i + 2])});
  }
  ExpectEdgesCancel(faces);
  EXPECT_EQ(VtuNumbers<std::int64_t>(xml, "offsets"), (std::vector<std::int64_t>{3, 6, 9, 12}));
  EXPECT_EQ(VtuNumbers<std::uint8_t>(xml, "types"), (std::vector<std::uint8_t>{5, 5, 5, 5}));
  EXPECT_EQ(xml.find("coordinates"), std::string::npos);
}

TEST_F(MeshFile, VtuSaysWhatTheMeshIs) {
  Mesh mesh = Surface(3);
  EXPECT_EQ(Saved(mesh, "a.vtu").find("\"epsilon\""), std::string::npos);
  mesh.report.termination = Termination::kVertexBudget;
  mesh.report.epsilon = 0.1;
  mesh.report.certificate.verdict = "not certified: max_vertices is spent";
  const std::string xml = Saved(mesh, "a.vtu");
  EXPECT_EQ(VtuNumbers<double>(xml, "epsilon"), std::vector<double>{0.1});
  EXPECT_EQ(VtuNumbers<std::uint8_t>(xml, "certified"), std::vector<std::uint8_t>{0});
  const auto verdict = VtuNumbers<char>(xml, "verdict");
  EXPECT_EQ(std::string(verdict.begin(), verdict.end()), mesh.report.certificate.verdict);
  const auto version = VtuNumbers<char>(xml, "version");
  EXPECT_EQ(std::string(version.begin(), version.begin() + 9), "stellate ");
}

TEST_F(MeshFile, VtuKeepsHighCoordinatesAsData) {
  const Mesh mesh = Surface(6);
  const std::string xml = Saved(mesh, "a.vtu");
  EXPECT_EQ(VtuNumbers<double>(xml, "coordinates"),
            std::vector<double>(mesh.points.data(), mesh.points.data() + 24));
  EXPECT_EQ(VtuNumbers<double>(xml, "Points").size(), 12u);
}

}  // namespace
}  // namespace stellate
