#include <algorithm>
#include <charconv>

#include "pipe/framing.h"
#include "pipe/numbers.h"
#include "stellate/command_oracle.h"

namespace stellate {
namespace {

tl::unexpected<Error> BadNumbers(std::string_view text, const std::string& wanted) {
  return Fail(ErrorCode::kRefused, pipe::Quoted(text) + " is not " + wanted);
}

// Numbers between commas; empty when they are none.
Eigen::VectorXd Coordinates(std::string_view text) {
  const std::vector<std::string_view> parts = pipe::Split(text, ',');
  Eigen::VectorXd numbers(std::ssize(parts));
  for (Eigen::Index i = 0; i < numbers.size(); ++i) {
    if (!pipe::ParseNumber(parts[static_cast<size_t>(i)], &numbers[i])) return {};
  }
  return numbers.allFinite() ? numbers : Eigen::VectorXd();
}

}  // namespace

Expected<BoundingBox> ParseBox(std::string_view text) {
  const std::vector<std::string_view> corners = pipe::Split(text, ':');
  if (corners.size() == 2) {
    BoundingBox box{Coordinates(corners[0]), Coordinates(corners[1])};
    if (box.lower.size() > 0 && box.lower.size() == box.upper.size() &&
        (box.lower.array() < box.upper.array()).all()) {
      return box;
    }
  }
  return BadNumbers(text,
                    "a box: the lower corner, a colon and the upper corner, such as "
                    "-1,-1,-1:1,1,1, the lower smaller in every coordinate");
}

Expected<Eigen::MatrixXd> ParsePoints(std::string_view text) {
  const std::vector<std::string_view> rows = pipe::Split(text, ';');
  Eigen::MatrixXd points;
  for (size_t j = 0; j < rows.size(); ++j) {
    const Eigen::VectorXd point = Coordinates(rows[j]);
    if (j == 0) points.resize(point.size(), std::ssize(rows));
    if (point.size() == 0 || point.size() != points.rows()) {
      return BadNumbers(text, "a list of points, such as 1,0,0;0,1,0, all of as many coordinates");
    }
    points.col(static_cast<Eigen::Index>(j)) = point;
  }
  return points;
}

namespace pipe {
namespace {

constexpr std::string_view kFirstWord = "stellate-oracle", kVersion = "1", kAbout = "about=";

template <typename T>
T Value(const Expected<T>& parsed) {
  if (!parsed) throw Garbled("its first line: " + parsed.error().message);
  return *parsed;
}

int Number(std::string_view word, std::string_view value, int most) {
  int number = 0;
  const char* const end = value.data() + value.size();
  const auto parsed = std::from_chars(value.data(), end, number);
  if (parsed.ptr != end || parsed.ec != std::errc() || number < 0 || number > most) {
    throw Garbled("its first line: " + Quoted(word) + " has to be a whole number up to " +
                  std::to_string(most));
  }
  return number;
}

void Understand(std::string_view word, Greeting* greeting) {
  constexpr int kMostDimensions = 1 << 20;  // servers allow far less
  constexpr int kMostWalls = 64;
  const size_t equals = word.find('=');
  const std::string_view key = word.substr(0, equals);
  const std::string_view value = equals < word.size() ? word.substr(equals + 1) : "";
  if (key == "k") {
    greeting->dimension = Number(word, value, kMostDimensions);
  } else if (key == "d") {
    greeting->ambient_dimension = Number(word, value, kMostDimensions);
  } else if (key == "tangents") {
    greeting->tangents = Number(word, value, 1) != 0;
  } else if (key == "flats") {
    greeting->flats = Number(word, value, 1) != 0;
  } else if (key == "sizes") {
    greeting->sizes = Number(word, value, 1) != 0;
  } else if (key == "walls") {
    greeting->walls = Number(word, value, kMostWalls);
  } else if (key == "box") {
    greeting->box = Value(ParseBox(value));
  } else if (key == "seeds") {
    greeting->seeds = Value(ParsePoints(value));
  } else {
    throw Garbled("its first line: " + Quoted(word) +
                  " is none of k= d= tangents= flats= sizes= walls= box= seeds= about=");
  }
}

}  // namespace

bool MayBecomeGreeting(std::string_view begun) {
  begun.remove_prefix(std::min(begun.find_first_not_of(" \t"), begun.size()));
  const size_t length = std::min(begun.size(), kFirstWord.size());
  return begun.substr(0, length) == kFirstWord.substr(0, length);
}

Greeting ParseGreeting(std::string_view line) {
  const std::vector<std::string_view> words = Words(line);
  if (words.empty() || words[0] != kFirstWord) {
    throw Garbled(
        "its first line has to be 'stellate-oracle 1 binary ...' or 'stellate-oracle 1 "
        "text ...' and is " +
        Quoted(line) + "; if that is a banner, there is an option to be without, as octave-cli -q");
  }
  if (words.size() < 3 || (words[2] != "binary" && words[2] != "text")) {
    throw Garbled("its first line has to say 'binary' or 'text' in third place: " + Quoted(line));
  }
  if (words[1] != kVersion) {
    throw Garbled("it speaks version " + Quoted(words[1]) + " of the pipe; here it is version 1");
  }
  Greeting greeting;
  greeting.text = words[2] == "text";
  for (size_t i = 3; i < words.size(); ++i) {
    if (words[i].starts_with(kAbout)) {
      greeting.about = words[i].substr(kAbout.size());
      while (++i < words.size()) greeting.about.append(" ").append(words[i]);
    } else {
      Understand(words[i], &greeting);
    }
  }
  return greeting;
}

}  // namespace pipe
}  // namespace stellate
