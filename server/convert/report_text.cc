#include "server/convert/report_text.h"

#include <algorithm>
#include <charconv>
#include <string_view>

#include "core/base/message.h"
#include "text/printable.h"

namespace stellate::server {
namespace {

using core::Message;

constexpr std::size_t kTitleWidth = 13, kIndent = kTitleWidth + 2, kLineWidth = 100;

// With so many significant digits, or, if `fixed`, so many after the point.
std::string Digits(double value, int digits, bool fixed = false) {
  char text[400];  // the largest double has 309 digits before the point
  const auto format = fixed ? std::chars_format::fixed : std::chars_format::general;
  return {text, std::to_chars(text, text + sizeof text, value, format, digits).ptr};
}

// 1234567 as 1,234,567.
std::string Grouped(std::uint64_t value) {
  std::string text = std::to_string(value);
  for (std::size_t i = text.size(); i > 3; i -= 3) text.insert(i - 3, 1, ',');
  return text;
}

class Entries {
 public:
  void Add(std::string_view title, std::string_view words) {
    std::string before(kIndent - 2 - std::min(title.size(), kTitleWidth), ' ');
    before.append(title).append(2, ' ');
    for (std::size_t end = 0; end != std::string_view::npos; words.remove_prefix(end + 1)) {
      end = words.find('\n');
      AddFolded(std::move(before), text::Printable(words.substr(0, end), '?'));
      before.assign(kIndent, ' ');
      if (end == std::string_view::npos) break;
    }
  }
  std::string Take() { return std::move(text_); }

 private:
  // One line of words, folded at spaces.
  void AddFolded(std::string before, std::string_view words) {
    constexpr std::size_t kRoom = kLineWidth - kIndent;
    while (words.size() > kRoom) {
      // The last space that leaves a full line, else the first one after a long word.
      std::size_t space = words.rfind(' ', kRoom);
      if (space == std::string_view::npos || space == 0) space = words.find(' ', 1);
      if (space == std::string_view::npos) break;
      text_.append(before).append(words.substr(0, space)).append(1, '\n');
      words.remove_prefix(space + 1);
      before.assign(kIndent, ' ');
    }
    text_.append(before).append(words).append(1, '\n');
  }

  std::string text_;
};

std::string_view Ending(v1::Termination termination) {
  switch (termination) {
    case v1::TERMINATION_CONVERGED:
      return "converged: no refinement rule applies any more";
    case v1::TERMINATION_VERTEX_BUDGET:
      return "stopped: max_vertices is spent";
    case v1::TERMINATION_ROUND_BUDGET:
      return "stopped: max_rounds is spent";
    case v1::TERMINATION_CANCELLED:
      return "cancelled";
    case v1::TERMINATION_ORACLE_FAILED:
      return "the oracle failed";
    case v1::TERMINATION_NO_PROGRESS:
      return "stopped: rules still apply, but refinement no longer helps";
    default:
      return "unknown";
  }
}

// ", Betti numbers 1 0 0 0"
std::string BettiNumbers(const google::protobuf::RepeatedField<std::int64_t>& betti) {
  std::string numbers;
  for (const std::int64_t number : betti) numbers += ' ' + std::to_string(number);
  return numbers.empty() ? ", Betti numbers not computed" : ", Betti numbers" + numbers;
}

// The mark in capitals, then the verdict without the words that say the same.
std::string Judgement(const v1::Certificate& c) {
  std::string_view mark = "NOT CERTIFIED";
  if (c.certified()) mark = c.level() == v1::CERTIFICATE_LEVEL_PROVED ? "PROVED" : "CERTIFIED";
  std::string_view verdict = c.verdict();
  for (const std::string_view said :
       {"Not certified: ", "not certified: ", "Certified: ", "Proved: "}) {
    if (!verdict.starts_with(said)) continue;
    verdict.remove_prefix(said.size());
    break;
  }
  return verdict.empty() ? std::string(mark) : Message(mark, ": ", verdict);
}

// `of_points`, as below: a reconstruction, which asked no oracle and was given no epsilon.
void AddTopology(const v1::Certificate& c, bool of_points, Entries* entries) {
  entries->Add("topology", Message(c.components() == 1 ? "1 component"
                                                       : Grouped(c.components()) + " components",
                                   ", Euler characteristic ", c.euler_characteristic(),
                                   c.orientable() ? ", orientable" : ", not orientable",
                                   c.betti_size() > 0 ? BettiNumbers(c.betti()) : ""));
  const bool ends = c.faces_size() > 0;  // the manifold, at its boundary
  const std::string closed = !c.closed()
                                 ? Message("not closed (", Grouped(c.bad_faces()), " bad faces)")
                             : ends ? "closed up to its boundary"
                                    : "closed";
  const std::string links =
      c.links_are_spheres() ? Message("every link a sphere ", ends ? "or a ball " : "", "(decided ",
                                      c.links_decided_exactly() ? "exactly)" : "by homology)")
                            : Grouped(c.bad_links()) + " links are not spheres";
  const bool is_pinched = c.links_are_spheres() && c.pinched_vertices() > 0;
  entries->Add("manifold",
               Message(closed, "; ", links,
                       is_pinched ? ", but where it is pinched, of each part alone" : ""));
  // Of a boundary alone stars are not looked at, and of points no flats.
  if (c.certified() && c.fibre_samples() == 0 && !of_points) return;
  std::string stars = Message(Grouped(c.inconsistent_simplices()), " inconsistent simplices, ",
                              Grouped(c.unembedded_stars()), " stars overlap");
  if (c.fibre_samples() > 0)
    stars += Message(", ", Grouped(c.fibre_failures()), " of ", Grouped(c.fibre_samples()),
                     " normal flats met wrongly");
  entries->Add("stars", stars);
}

// Simplices are chords: what they measure is off by a share of about (epsilon / reach)^2.
void AddSize(const v1::Certificate& c, int k, Entries* entries) {
  if (!(c.volume() > 0)) return;
  constexpr const char* kNames[] = {"", "length", "area", "volume"};
  std::string words =
      Message(k <= 3 ? kNames[k] : std::to_string(k) + "-volume", " ", Digits(c.volume(), 6));
  const double share = c.epsilon_over_reach() * c.epsilon_over_reach();
  if (c.certified() && share > 0)
    words += Message(", off by O(epsilon^2): a share of about ", Digits(share, 1));
  entries->Add("measure", words);
}

void AddMeasures(const v1::Certificate& c, bool of_points, Entries* entries) {
  std::string shape =
      Message("largest circumradius ", Digits(c.max_circumradius(), 4), ", radius-edge ratio ",
              Digits(c.max_radius_edge(), 3), "; smallest fatness ", Digits(c.min_fatness(), 3));
  if (c.min_angle_degrees() > 0)
    shape += Message(", angle ", Digits(c.min_angle_degrees(), 1, true), " degrees");
  entries->Add("shape", shape);
  const std::string barycentres =
      of_points ? ""
                : Message("barycentres within ", Digits(c.max_barycentre_distance(), 3),
                          " of the manifold, ");
  entries->Add("closeness", Message(barycentres, "simplices within ",
                                    Digits(c.max_tangent_angle_degrees(), 1, true),
                                    " degrees of its tangent spaces"));
  // What was refused may be far too coarse to tell the reach.
  entries->Add(
      "reach",
      Message(c.certified() ? "about " : "at most ", Digits(c.estimated_reach(), 4),
              of_points ? ", the largest circumradius is " : ", epsilon is ",
              Digits(c.epsilon_over_reach(), 3), " of it", c.certified() ? "" : " or more"));
  if (c.declared_reach() <= 0) return;
  std::string proved = ": nothing proved from it";
  if (c.reach_refuted()) {
    proved = ", refuted";
  } else if (c.level() == v1::CERTIFICATE_LEVEL_PROVED) {
    proved = Message(": within ", Digits(c.proved_distance(), 3), " of the manifold, proved");
  }
  entries->Add("declared", Message("a reach of ", Digits(c.declared_reach(), 4), proved));
}

// What became of the points, and how they lie.
void AddPoints(const v1::ReconstructionReport& r, Entries* entries) {
  std::string places;
  for (const v1::ReconstructionReport::Count& one : r.places()) {
    std::string name = v1::Place_Name(one.place());
    if (const std::string_view prefix = "PLACE_"; name.starts_with(prefix)) {
      name.erase(0, prefix.size());
    }
    places += Message(places.empty() ? "" : ", ", Grouped(one.points()), " ", name);
  }
  entries->Add("points", places);
  entries->Add("sample",
               Message("spacing ", Digits(r.spacing(), 4), ", noise ", Digits(r.noise(), 3), ", ",
                       Digits(r.noise_ratio(), 3), " of the local spacing",
                       r.smoothed() ? ": the complex is that of smoothed copies" : ""));
  entries->Add("stars",
               Message(Grouped(r.doubtful()), " simplices in doubt at first, in ",
                       Grouped(r.cavities()), " cavities; ", Grouped(r.tiles()), " tiles, ",
                       Grouped(r.unfilled_vertices()), " vertices in cavities that are left"));
}

void AddRefinement(const v1::Counts& n, Entries* entries) {
  const std::string protection =
      n.inserted_protection() > 0 ? Message(", protection ", Grouped(n.inserted_protection())) : "";
  entries->Add("inserted for", Message("size ", Grouped(n.inserted_size()), ", radius-edge ",
                                       Grouped(n.inserted_radius_edge()), ", slivers ",
                                       Grouped(n.inserted_sliver()), ", inconsistencies ",
                                       Grouped(n.inserted_inconsistent()), protection));
}

void AddProtection(const v1::Protection& p, Entries* entries) {
  const std::string reached = p.weak() == 0 ? "reached"
                                            : Message("not reached by ", Grouped(p.weak()),
                                                      p.weak() == 1 ? " simplex" : " simplices");
  entries->Add("protection", Message(Digits(p.asked(), 3), " asked, ", reached, ": gaps from ",
                                     Digits(p.least(), 3), ", ", Digits(p.percentile(), 3),
                                     " or more of 99 %, median ", Digits(p.median(), 3)));
  const std::string stable = p.stability_radius() > 0
                                 ? Message("no simplex changes while vertices move by less than ",
                                           Digits(p.stability_radius(), 3), ", ")
                                 : std::string();
  entries->Add(
      "stability",
      Message(stable, "thickness at least ", Digits(p.thickness_bound(), 3),
              p.is_delaunay() ? "; intrinsic, restricted and tangential Delaunay: proved" : ""));
}

// "2 (grain)", or the label alone where it has no name.
std::string Named(std::uint32_t label, const std::vector<std::string>& names) {
  const bool has_name = label > 0 && label <= names.size() && !names[label - 1].empty();
  return has_name ? Message(label, " (", names[label - 1], ")") : std::to_string(label);
}

// A line for each region and each interface, and where they touch themselves.
void AddRegions(const v1::Certificate& c, const std::vector<std::string>& names, Entries* entries) {
  for (const v1::RegionCertificate& region : c.regions()) {
    std::string words =
        Message("label ", Named(region.label(), names), ": ", Grouped(region.simplices()),
                " simplices, volume ", Digits(region.volume(), 6), BettiNumbers(region.betti()));
    if (region.min_dihedral_degrees() > 0)
      words +=
          Message(", angles from ", Digits(region.min_dihedral_degrees(), 1, true), " degrees on");
    entries->Add("region", words);
  }
  for (const v1::FaceCertificate& face : c.faces()) {
    if (!face.has_label_below()) continue;
    entries->Add(
        "interface",
        Message("wall ", face.walls(0), ", between ", Named(face.label_below(), names), " and ",
                Named(face.label_above(), names), ": ", Grouped(face.simplices()),
                " simplices, area ", Digits(face.volume(), 6), BettiNumbers(face.betti())));
  }
  if (c.pinched_vertices() > 0)
    entries->Add("pinched", Message("at ", Grouped(c.pinched_vertices()),
                                    " vertices, where the manifold or a "
                                    "region touches itself in an edge or a point alone"));
}

}  // namespace

std::string ReportText(const v1::Report& report, int k, const std::vector<std::string>& names) {
  const v1::Counts& n = report.counts();
  const v1::Certificate& c = report.certificate();
  Entries entries;
  entries.Add("mesh",
              Message(Grouped(n.vertices()), " vertices, ", Grouped(n.simplices()), " simplices"));
  const std::string seconds = Message(Digits(report.elapsed_seconds(), 2, true), " s");
  if (report.has_reconstruction()) {
    entries.Add("run", "reconstructed from points");
    entries.Add("took", seconds);
    AddPoints(report.reconstruction(), &entries);
  } else {
    entries.Add("run", Ending(report.termination()));
    entries.Add("took", Message(seconds, ", ", Grouped(n.rounds()), " round trips, ",
                                Grouped(n.queries()), " queries"));
    AddRefinement(n, &entries);
  }
  if (report.has_failure()) {
    entries.Add("failure", Message(report.failure().reason(), ": ", report.failure().message()));
  }
  entries.Add("certificate", Judgement(c));
  if (c.components() > 0) {
    AddTopology(c, report.has_reconstruction(), &entries);
    AddSize(c, k, &entries);
    AddMeasures(c, report.has_reconstruction(), &entries);
    AddRegions(c, names, &entries);
    if (c.has_protection()) AddProtection(c.protection(), &entries);
  }
  for (const std::string& warning : c.warnings()) entries.Add("warning", warning);
  return entries.Take();
}

}  // namespace stellate::server
