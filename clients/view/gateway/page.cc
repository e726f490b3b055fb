#include "page.h"

// What build-page made: the page, or in its place why there is none.
__asm__(
    ".section .rodata\n"
    ".global stellate_view_page\n"
    "stellate_view_page:\n"
    ".incbin \"" STELLATE_PAGE
    "\"\n"
    ".global stellate_view_page_end\n"
    "stellate_view_page_end:\n"
    ".byte 0\n"
    ".previous\n");
extern "C" {
extern const char stellate_view_page[];
extern const char stellate_view_page_end[];
}

namespace stellate::view {
namespace {

// Where the page keeps its recording: empty until there is one.
constexpr std::string_view kPlace = "id=\"recording\">";

}  // namespace

Expected<std::string_view> Page() {
  const std::string_view page(stellate_view_page,
                              static_cast<size_t>(stellate_view_page_end - stellate_view_page));
  if (page.substr(0, 1) == "<") return page;
  return Fail(ErrorCode::kRefused,
              "this build carries no viewer: " + std::string(page) +
                  ". Install nodejs and npm and build again with a network; or `stellate download` "
                  "the mesh, and open the file elsewhere");
}

Expected<std::string> PageWith(std::string_view recording) {
  const Expected<std::string_view> page = Page();
  if (!page) return tl::unexpected(page.error());
  const size_t place = page->find(kPlace);
  if (place == std::string_view::npos) {
    return Fail(ErrorCode::kRefused, "the viewer's page has no place for a recording");
  }
  const size_t after = place + kPlace.size();
  std::string whole(page->substr(0, after));
  whole.append(recording).append(page->substr(after));
  return whole;
}

}  // namespace stellate::view
