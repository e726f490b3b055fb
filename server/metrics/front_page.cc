#include "server/metrics/front_page.h"

#include <sstream>

#include "server/base/version.h"
#include "server/session/session_state.h"

namespace stellate::server {
namespace {

constexpr const char* kHead =
    "<!DOCTYPE html><html lang=\"en\"><meta charset=\"utf-8\"><meta name=\"viewport\" "
    "content=\"width=device-width\"><title>stellated</title><style>body{font:16px/1.5 sans-serif;"
    "max-width:40rem;margin:3rem auto;padding:0 1rem;color:#222;background:#fff}"
    "table{border-collapse:collapse}td{padding:.2rem 1.5rem .2rem 0}"
    "td+td{text-align:right;font-variant-numeric:tabular-nums}"
    "@media(prefers-color-scheme:dark){body{color:#ddd;background:#181818}a{color:#8bf}}</style>";

}  // namespace

std::string FrontPage(const Counts& counts, const std::string& why_not) {
  std::ostringstream page;
  const auto row = [&page](const std::string& what, std::size_t count) {
    page << "<tr><td>" << what << "<td>" << count;
  };
  page << kHead << "<h1>stellated " << Version() << "</h1><p>"
       << (why_not.empty() ? "Serving." : "No new meshes are taken: " + why_not + ".")
       << " Meshes are made, watched and ended over gRPC, at another address than this: "
          "<code>stellate top</code> and <code>stellate view</code> show "
          "them.<h2>Meshes</h2><table>";
  for (const auto& [state, count] : counts.states) row(SessionStateName(state), count);
  row("with questions and no worker", counts.idle);
  page << "</table><h2>Now</h2><table>";
  row("workers", counts.workers);
  row("watchers", counts.watchers);
  row("vertices", counts.vertices);
  row("questions without an answer yet", counts.waiting);
  page << "</table><p><a href=\"/metrics\">/metrics</a> for Prometheus, "
          "<a href=\"/healthz\">/healthz</a> for probes.</html>\n";
  return page.str();
}

}  // namespace stellate::server
