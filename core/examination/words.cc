#include "core/examination/words.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstddef>
#include <sstream>
#include <stdexcept>
#include <string_view>

#include "core/base/message.h"
#include "core/examination/constants.h"

namespace stellate::core {
namespace examination {
namespace {

constexpr Eigen::Index kShownEntries = 6;

struct Words {
  const char* code;
  Severity severity;
  const char* message;  // with {values}
  const char* advice;   // may be empty
};

// All findings. An error keeps a mesh from coming out right; a warning may; a note is worth
// knowing.
constexpr Words kWords[] = {
    {"BAD_DIMENSIONS", Severity::kError, "dimension is {k} and ambient_dimension is {d}",
     "A manifold needs 1 <= dimension < ambient_dimension; what walls leave of space has both "
     "the same."},
    {"NO_WHEREABOUTS", Severity::kError,
     "there is neither a bounding box, lower < upper in all {d} coordinates, nor a seed with "
     "{d} coordinates",
     "Say where M is: a box around it, or one point near each of its components."},
    {"RAISED", Severity::kError, "{method} failed on a batch of {n}: {what}",
     "Answer every query. Where there is no answer, say so instead: found = false, or "
     "NotConverged."},
    {"WRONG_SHAPE", Severity::kError, "{what}",
     "Return a whole batch, of the shape that is named."},
    {"INEXACT", Severity::kError, "{what}",
     "Compute in double precision throughout; solve and integrate to twelve digits."},
    {"NOT_FINITE", Severity::kError, "{what}",
     "Where there is no answer, say so instead: found = false, or NotConverged."},
    {"NOTHING_FOUND", Severity::kError,
     "closest_point found nothing from any of {n} starting points, {query} for one",
     "Check the bounding box or the seeds, and whether the solver converges at all."},
    {"MOSTLY_NOT_FOUND", Severity::kWarning,
     "closest_point found nothing from {lost} of {n} starting points, {query} for one",
     "Seeds near M make up for it; so does a solver that converges from farther away."},
    {"OUTSIDE_BOX", Severity::kWarning,
     "M reaches out of its bounding box: {answer} is a point of M",
     "Is M open or unbounded? Cut it by walls, a box for instance (in Python keep='box'). If it "
     "is closed, make the box larger; components outside it are not looked for."},
    {"NOT_DETERMINISTIC", Severity::kError,
     "the same question, {query}, got the answer {answer} first and {other} the second time",
     "Answers must depend on the question alone: start solvers from the same state, and seed what "
     "is random."},
    {"BATCH_DEPENDENT", Severity::kError,
     "{query} is answered {answer} among others and {other} alone",
     "Answer each query by itself: batches are cut differently from run to run."},
    {"NOT_IDEMPOTENT", Severity::kError,
     "closest_point moves its own answer {query} to {answer}, by {moved}",
     "Answer with points of M: let the solver go on until it no longer moves, and project the "
     "result."},
    {"NOISY", Severity::kWarning,
     "answers of closest_point are exact to {moved} only, as at {query}",
     "Harmless below a hundredth of epsilon; closer to it, tighten the solver's tolerance."},
    {"TOUCHES_ZERO", Severity::kError, "{what}",
     "Solvers find where a function passes through zero: take what is squared, or a signed "
     "distance."},
    {"WRONG_DERIVATIVE", Severity::kError, "{what}", "Correct the derivatives, or leave them out."},
    {"NOT_CLOSEST", Severity::kError,
     "the closest point to {query} is said to be {answer}, at distance {own}, but {other}, an "
     "answer too, is nearer: {seen}",
     "Return the nearest point of all, not the first critical point of the distance."},
    {"NOT_CLOSEST_FAR", Severity::kWarning,
     "far from M, at {query}, the closest point is said to be {answer}, at distance {own}, but "
     "{other}, an answer too, is nearer: {seen}",
     "Near M it is right, which is what refinement needs; seeds near M keep it from starting "
     "far away."},
    {"NOT_NORMAL", Severity::kError,
     "the way from {query} to its closest point {answer} should be normal to M, and is {degrees} "
     "degrees off",
     "Return the nearest point, not one on the way to it: check the solver's stopping rule and "
     "metric."},
    {"WRONG_DIMENSION", Severity::kError,
     "near {query} M has dimension {rank}, and dimension says {k}",
     "Correct the dimension. If it is right, M has a corner or an end there, or closest_point "
     "jumps: ends take walls."},
    {"TANGENT_NOT_ORTHONORMAL", Severity::kError,
     "the tangent basis at {query} is not orthonormal: off by {off}",
     "Orthonormalise the basis (QR), and return its vectors as columns, (n, d, k)."},
    {"TANGENT_WRONG", Severity::kError,
     "the tangent basis at {query} is off by {degrees} degrees from the way closest points move "
     "there",
     "Check tangent_basis for the layout (n, d, k), and for the point that it is taken at."},
    {"SIZE_WRONG", Severity::kError,
     "the size at {query} is {size}, and that is no positive length",
     "local_size says how large things are at a point: the local feature size, or any positive "
     "length."},
    {"SIZE_CHANGES", Severity::kError,
     "the size at {query} is {size} first and {other} the next time",
     "A size must depend on its point alone, and not on the rest of the batch."},
    {"NOTHING_LEFT", Severity::kError,
     "all {n} points that were seen lie beyond a wall, {query} beyond wall {wall}",
     "A wall's value is positive inside: is a sign the wrong way round?"},
    {"FACE_OFF_MANIFOLD", Severity::kError,
     "the point {query} of wall {wall} is {moved} off M, says closest_point",
     "Answer with points where M meets the wall: solve for both."},
    {"FACE_CLEARANCE", Severity::kError,
     "at {query}, which face_point puts on wall {wall}, the wall's value is {clearance}: it is "
     "zero {off} away",
     "face_point and clearances have to be of the same walls, in the same order."},
    {"FACE_NOT_CLOSEST", Severity::kError,
     "the point of wall {wall} nearest to {query} is said to be {answer}, at distance {own}, "
     "but {other} is nearer: {seen}",
     "Return the nearest point of M where the wall is zero, at least from near by."},
    {"FACE_MISSED", Severity::kError,
     "no point of wall {wall} is found from {query}, though {other} is one, {seen} away",
     "A mesh asks from so near: is everything finite there, that is solved for, and does M go on "
     "beyond the wall for as far as epsilon?"},
    {"FACE_NOT_FOUND", Severity::kError,
     "wall {wall} changes its sign on M near {query}, but no point of M where it is zero is "
     "found",
     "Its function has to pass through zero with a slope, as x does: x^3 and sign(x) have none "
     "to go by."},
    {"CONORMAL_NOT_UNIT", Severity::kError,
     "the conormal of wall {wall} at {query} has the length {length}",
     "Divide it by its length, after it has been projected onto the tangent space."},
    {"CONORMAL_NOT_TANGENT", Severity::kError,
     "the conormal of wall {wall} at {query} is {degrees} degrees off M's tangent space",
     "Project the wall's outward normal onto the tangent space, then divide it by its length."},
    {"CONORMAL_INWARD", Severity::kError,
     "the conormal of wall {wall} at {query} points inwards: the wall's value grows along it",
     "The conormal points where the value falls: minus the gradient."},
    {"CONORMAL_WRONG", Severity::kError,
     "the conormal of wall {wall} at {query} is {degrees} degrees off from where the wall's "
     "value falls most",
     "It is normal to the face within M: minus the gradient, projected onto the tangent space."},
    {"WALL_TOUCHES", Severity::kWarning,
     "wall {wall} nearly touches M at {query}: its value hardly changes along M there",
     "Walls have to cross M at an angle. Move the wall, or take another function with the same "
     "zeros."},
    {"WALLS_TANGENTIAL", Severity::kError,
     "walls {wall} and {other} meet at {query} at {degrees} degrees, nearly tangentially",
     "Walls have to cross each other at an angle: move one, or make one wall of the two."},
    {"ACUTE_EDGE", Severity::kWarning,
     "walls {wall} and {other} meet at {query} at {degrees} degrees inside M",
     "From {least} degrees up any mesh comes to its end; sharper edges of solids may not be "
     "certified."},
    {"WALL_CUTS_NOTHING", Severity::kNote,
     "wall {wall} bounds nothing that was seen: no point of it lies inside the other walls", ""},
    {"ROUGH", Severity::kError,
     "M bends by {degrees} degrees within {length} of {query}: that is a corner, not a smooth "
     "manifold",
     "Round it off, or split M: stars never agree at corners."},
    {"FLAT_MISSED", Severity::kError,
     "the flat through {query} meets M at {answer}, within the radius {radius}, and "
     "intersect_flat found nothing",
     "Start from the closest point and solve within the flat; without intersect_flat, closest "
     "points do."},
    {"FLAT_OFF", Severity::kError,
     "the intersection {answer} for the centre {query} is {off} off the flat",
     "The flat is all y with basis^T (y - centre) = 0: the basis spans what is normal to the "
     "flat."},
    {"FLAT_OUTSIDE_RADIUS", Severity::kError,
     "the intersection {answer} is {own} from the centre {query}, beyond the radius {radius}",
     "Report none where the nearest intersection is beyond the radius."},
    {"FLAT_OFF_MANIFOLD", Severity::kError,
     "the intersection {answer} for the centre {query} is {moved} off M, says closest_point",
     "Answer with points of M: solve for both, the flat and M."},
    {"FLAT_NOT_NEAREST", Severity::kError,
     "the flat through {query} meets M at {other}, {seen} away, and intersect_flat returned "
     "{answer}, {own} away",
     "Return the intersection nearest the centre."},
    {"COARSE_EPSILON", Severity::kWarning,
     "epsilon {epsilon} is {ratio} of the reach, which is about {reach}",
     "Stay below 0.4 of the reach: {advised} or less."},
    {"SLOW", Severity::kWarning,
     "{rate} queries a second at best, in batches of {batch}: 100,000 vertices take about "
     "{minutes} minutes",
     "Answer whole batches with array operations, or let several workers serve the mesh."},
    {"REACH", Severity::kNote,
     "the reach is about {reach}, an estimate from above; epsilon up to {advised} should do", ""},
    {"PIECES", Severity::kNote,
     "{n} points of M lie on {pieces} of its components; others, where no starting point fell, "
     "may exist",
     ""},
    {"NO_TANGENTS", Severity::kNote,
     "there is no tangent_basis: the server reads tangent spaces off closest points; only where "
     "epsilon is coarse beside the reach it asks for up to {extra} more of these a vertex",
     ""},
    {"SPEED", Severity::kNote,
     "{rate} queries a second in batches of {batch}, {single} one at a time", ""},
};

std::string Digits(double value, int digits) {
  char text[40];
  const auto end =
      std::to_chars(text, text + sizeof(text), value, std::chars_format::general, digits).ptr;
  return std::string(text, end);
}

std::string Grouped(std::int64_t value) {
  std::string digits = Message(value);
  const std::size_t first = value < 0 ? 1 : 0;
  for (std::size_t at = digits.size(); at > first + 3; at -= 3) digits.insert(at - 3, 1, ',');
  return digits;
}

std::string Fill(std::string text, std::initializer_list<Value> values) {
  for (const Value& value : values) {
    const std::string slot = "{" + value.name + "}", shown = Show(value);
    for (std::size_t at = text.find(slot); at != std::string::npos; at = text.find(slot, at)) {
      text.replace(at, slot.size(), shown);
      at += shown.size();
    }
  }
  return text;
}

// Lines of at most `width` columns, all but the first indented.
std::string Fold(const std::string& text, std::size_t width, std::size_t indent) {
  std::istringstream words(text);
  std::string folded, line = text.substr(0, text.find_first_not_of(' '));
  bool is_first = true;
  for (std::string word; words >> word; is_first = false) {
    if (!is_first && line.size() + 1 + word.size() > width) {
      folded += line + "\n";
      line = std::string(indent, ' ') + word;
    } else {
      line += (is_first ? "" : " ") + word;
    }
  }
  return folded + line + "\n";
}

std::string Line(const Finding& finding) {
  constexpr std::size_t kWidth = 100, kIndent = 8;
  const std::string name = SeverityName(finding.severity);
  std::string line = std::string(7 - name.size(), ' ') + name + " " + finding.code + ": " +
                     finding.message + (finding.message.ends_with('.') ? "" : ".");
  if (!finding.advice.empty()) line += " " + finding.advice;
  return Fold(line, kWidth, kIndent);
}

std::string Count(const ExaminationReport& report, Severity severity) {
  const auto count = std::count_if(report.findings.begin(), report.findings.end(),
                                   [&](const Finding& f) { return f.severity == severity; });
  return Message(count, " ", SeverityName(severity), count == 1 ? "" : "s");
}

}  // namespace

std::string Show(const Value& value) {
  struct Shown {
    std::string operator()(double number) const { return Brief(number); }
    std::string operator()(std::int64_t number) const { return Grouped(number); }
    std::string operator()(const std::string& words) const { return words; }
    std::string operator()(const Eigen::VectorXd& point) const {
      std::string text = "[";
      for (Eigen::Index i = 0; i < std::min(point.size(), kShownEntries); ++i)
        text += (i > 0 ? ", " : "") + Digits(point[i], 6);
      return text + (point.size() > kShownEntries ? ", ...]" : "]");
    }
  };
  return std::visit(Shown{}, value.value);
}

Finding MakeFinding(const std::string& code, std::initializer_list<Value> values) {
  const auto* const words = std::find_if(std::begin(kWords), std::end(kWords),
                                         [&](const Words& w) { return code == w.code; });
  if (words == std::end(kWords)) throw std::logic_error("there are no words for " + code);
  Finding finding{
      words->severity, code, Fill(words->message, values), Fill(words->advice, values), {}, {}};
  for (const Value& value : values) {
    if (const auto* const number = std::get_if<double>(&value.value))
      finding.numbers.emplace_back(value.name, *number);
    if (const auto* const count = std::get_if<std::int64_t>(&value.value))
      finding.numbers.emplace_back(value.name, static_cast<double>(*count));
    const auto* const point = std::get_if<Eigen::VectorXd>(&value.value);
    if (point != nullptr && (value.name == "query" || finding.place.size() == 0))
      finding.place = *point;
  }
  return finding;
}

double ToTwoDigits(double length) {
  const std::string text = Digits(length, 2);
  double rounded = length;
  std::from_chars(text.data(), text.data() + text.size(), rounded);
  return rounded;
}

}  // namespace examination

const char* SeverityName(Severity severity) {
  switch (severity) {
    case Severity::kError:
      return "error";
    case Severity::kWarning:
      return "warning";
    case Severity::kNote:
      break;
  }
  return "note";
}

bool ExaminationReport::ok() const {
  return std::none_of(findings.begin(), findings.end(),
                      [](const Finding& f) { return f.severity == Severity::kError; });
}

std::string ToText(const ExaminationReport& report) {
  std::string text;
  for (const Finding& finding : report.findings) text += examination::Line(finding);
  return text + Message("The oracle ", report.ok() ? "keeps" : "breaks",
                        " its contract: ", examination::Count(report, Severity::kError), ", ",
                        examination::Count(report, Severity::kWarning), ", from ",
                        examination::Grouped(static_cast<std::int64_t>(report.queries)),
                        " queries about ",
                        examination::Grouped(static_cast<std::int64_t>(report.samples)),
                        " points of M.\n");
}

ChosenEpsilon ChooseEpsilon(const ExaminationReport& report) {
  if (!report.ok()) {
    std::string words =
        "the reach is taken from the oracle's answers, and they cannot be trusted:\n";
    for (const Finding& finding : report.findings)
      if (finding.severity == Severity::kError) words += examination::Line(finding);
    return {0, words.substr(0, words.size() - 1), "ORACLE_BREAKS_CONTRACT"};
  }
  if (!report.reach || !std::isfinite(*report.reach)) {
    return {0,
            "the reach is taken from the oracle's answers, and they show none: say how large "
            "epsilon should be",
            "ORACLE_NO_REACH"};
  }
  return {examination::ToTwoDigits(*report.reach / examination::kAutoEpsilon),
          Message("a quarter of the reach, about ", examination::Digits(*report.reach, 3), " by ",
                  examination::Grouped(static_cast<std::int64_t>(report.queries)), " queries"),
          ""};
}

std::optional<ChosenEpsilon> ChooseFinerEpsilon(const Report& report, double epsilon) {
  const Certificate& c = report.certificate;
  const bool ended = report.termination == Termination::kConverged ||
                     report.termination == Termination::kNoProgress;
  const double coarsest = examination::kSafeRatio * c.estimated_reach;
  if (c.certified || c.reach_refuted || !ended || !(coarsest > 0 && coarsest < epsilon)) return {};
  const std::string why = Message(
      "a quarter of the reach, about ", examination::Digits(c.estimated_reach, 3),
      " by the certificate of epsilon ", examination::Digits(epsilon, 6), ", which was too coarse");
  const double quarter = examination::ToTwoDigits(c.estimated_reach / examination::kAutoEpsilon);
  const double least = examination::ToTwoDigits(examination::kAutoLeastShare * epsilon);
  if (quarter < least) return ChosenEpsilon{least, "no finer in one step, though " + why, ""};
  return ChosenEpsilon{quarter, why, ""};
}

}  // namespace stellate::core
