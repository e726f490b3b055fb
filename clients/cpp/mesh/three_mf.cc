// 3MF, what slicers for 3D printers read: an object a region, in millimetres (core specification
// 1.3).
#include <array>
#include <charconv>
#include <string>
#include <string_view>

#include "mesh/formats.h"
#include "mesh/parts.h"
#include "mesh/xml.h"
#include "mesh/zip.h"
#include "stellate/version.h"

namespace stellate::client {
namespace {

constexpr std::string_view kContentTypes =
    R"(<?xml version="1.0" encoding="UTF-8"?>
<Types xmlns="http://schemas.openxmlformats.org/package/2006/content-types">)"
    R"(<Default Extension="rels" ContentType="application/vnd.openxmlformats-package.relationships+xml"/>)"
    R"(<Default Extension="model" ContentType="application/vnd.ms-package.3dmanufacturing-3dmodel+xml"/>)"
    "</Types>\n";
constexpr std::string_view kRelations =
    R"(<?xml version="1.0" encoding="UTF-8"?>
<Relationships xmlns="http://schemas.openxmlformats.org/package/2006/relationships">)"
    R"(<Relationship Target="/3D/3dmodel.model" Id="model" )"
    R"(Type="http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"/></Relationships>)"
    "\n";
constexpr std::string_view kModel =
    R"(<?xml version="1.0" encoding="UTF-8"?>
<model unit="millimeter" xml:lang="en" xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02">
<metadata name="Application">stellate )" STELLATE_VERSION R"(</metadata>
<resources>
)";

// An element whose attributes have these names, one character or two, and the column's values.
template <typename Column>
void AddElement(std::string* xml, const char* element, const std::array<const char*, 3>& names,
                const Column& values) {
  (*xml) += element;
  for (Eigen::Index i = 0; i < 3; ++i) {
    (*xml) += names[static_cast<std::size_t>(i)];
    std::array<char, 32> number;
    char* const first = number.data();
    char* const end = first + number.size();
    if constexpr (std::is_floating_point_v<typename Column::Scalar>) {
      xml->append(first, std::to_chars(first, end, values[i], std::chars_format::general, 17).ptr);
    } else {
      xml->append(first, std::to_chars(first, end, values[i]).ptr);
    }
  }
  (*xml) += "\"/>\n";
}

}  // namespace

Expected<std::string> ThreeMf(const Mesh& mesh) {
  const auto parts = PartsOf(mesh, ".3mf");
  if (!parts) return tl::unexpected(parts.error());
  std::string xml(kModel), items;
  int number = 0;
  for (const Part& part : *parts) {
    const std::string id = std::to_string(++number);
    // "model": what is closed, and can be printed; "surface": what is not.
    const std::string type = part.is_closed ? "model" : "surface";
    xml.append("<object id=\"").append(id).append("\" type=\"").append(type);
    xml.append("\" name=\"").append(EscapedXml(part.name)).append("\"><mesh><vertices>\n");
    for (const auto& point : part.points.colwise())
      AddElement(&xml, "<vertex", {" x=\"", "\" y=\"", "\" z=\""}, point);
    xml += "</vertices><triangles>\n";
    for (const auto& triangle : part.triangles.colwise())
      AddElement(&xml, "<triangle", {" v1=\"", "\" v2=\"", "\" v3=\""}, triangle);
    xml += "</triangles></mesh></object>\n";
    items.append("<item objectid=\"").append(id).append("\"/>\n");
  }
  xml += "</resources><build>\n" + items + "</build></model>\n";
  Zip zip;
  zip.Add("[Content_Types].xml", kContentTypes);
  zip.Add("_rels/.rels", kRelations);
  zip.Add("3D/3dmodel.model", xml);
  return zip.Finish();
}

}  // namespace stellate::client
