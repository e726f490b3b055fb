// What a command says through the pipe, in pieces of any size: refused with words, or an answer of
// just the shape that was asked for, finite wherever found.
//
// An input is four bytes that choose the question and the pieces, and what the command says: a
// first line, or an answer.

#include "pipe/framing.h"
#include "tests/fuzz/target.h"

namespace stellate::fuzz {
namespace {

void Greet(const std::string& line) {
  const pipe::Greeting greeting = pipe::ParseGreeting(line);
  if (greeting.box) {
    Require((greeting.box->lower.array() < greeting.box->upper.array()).all(), "a box has room");
  }
  Require(greeting.seeds.allFinite(), "seeds are finite");
}

void Check(const pipe::Question& question, const Answer& answer) {
  const Eigen::Index n = question.points.cols(), d = question.points.rows();
  Require(answer.points.rows() == d && answer.points.cols() == n, "points' shape");
  Require(answer.found.empty() || std::ssize(answer.found) == n, "found's shape");
  Require(!question.tangents || answer.tangents.rows() == d * question.dimension, "tangents' rows");
  Require(answer.tangents.cols() == (question.tangents ? n : 0), "tangents' columns");
  Require(answer.sizes.size() == (question.sizes ? n : 0), "sizes' shape");
  for (Eigen::Index j = 0; j < n; ++j) {
    Require(!answer.IsFound(j) || answer.points.col(j).allFinite(), "points are finite");
  }
}

void Listen(const pipe::Question& question, bool text, size_t step, const std::string& said) {
  const auto reader = pipe::AnswerReader::Make(question, text);
  std::string unread;
  for (size_t at = 0; at < said.size(); at += step) {
    unread += said.substr(at, step);
    if (reader->Take(&unread)) return Check(question, reader->Finish());
  }
}

}  // namespace

std::vector<std::string> Seeds() {
  std::vector<std::string> seeds;
  seeds.push_back(
      std::string(4, '\0') +
      "stellate-oracle 1 binary k=2 d=3 tangents=1 box=-1,-1,-1:1,1,1 seeds=1,0,0;0,1,0");
  // One surface's point in space, with tangents, a size and found.
  seeds.push_back(std::string("\1\6\0\0", 4) + "1 0 0 0 0 1 0 0 1 0.5\n");
  seeds.push_back(std::string("\1\6\1\2", 4) + "1e-3 0 0\n-\n");
  seeds.push_back(std::string("\1\6\0\0", 4) + "error no licence\n");
  std::string binary("\1\0\0\0\7\0\0\0", 8);
  for (int i = 0; i < 10; ++i) binary += std::string("\0\0\0\0\0\0\xf0\x3f", 8);
  seeds.push_back(std::string("\2\6\0\0", 4) + binary + "\1");
  seeds.push_back(std::string("\2\6\0\3", 4) + std::string("\4\0\0\0\10\0\0\0oops", 12));
  return seeds;
}

}  // namespace stellate::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace stellate;
  fuzz::Script script(data, size);
  const int what = script.Byte() % 3;
  const std::uint8_t wanted = script.Byte();
  const Eigen::MatrixXd points = Eigen::MatrixXd::Constant(3, 1 + script.Byte() % 4, 0.5);
  const size_t step = 1 + script.Byte();
  const pipe::Question question{1 + wanted % 2,    points,           nullptr, nullptr,
                                (wanted & 2) != 0, (wanted & 4) != 0};
  try {
    if (what == 0) fuzz::Greet(script.Rest());
    if (what != 0) fuzz::Listen(question, what == 1, step, script.Rest());
  } catch (const pipe::Garbled&) {
  } catch (const pipe::CommandError&) {
  }
  return 0;
}
