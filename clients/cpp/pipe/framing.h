#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <iterator>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>

#include "stellate/oracle.h"

// What goes through the pipe, as bytes; docs/using/pipe.md is its specification.
namespace stellate::pipe {

// What came is not what the specification wants; what() says where and what.
struct Garbled : std::runtime_error {
  using std::runtime_error::runtime_error;
};

constexpr size_t kMaxGreetingBytes = 1 << 20;
constexpr size_t kMaxErrorBytes = 1 << 16;

// A command's first line.
struct Greeting {
  bool text = false;
  std::optional<int> dimension, ambient_dimension;
  bool tangents = false, flats = false, sizes = false;
  int walls = 0;
  std::optional<BoundingBox> box;
  Eigen::MatrixXd seeds;  // d x m
  std::string about;
};

// Whether `begun` is how a first line begins. What is not is never one, whatever follows.
bool MayBecomeGreeting(std::string_view begun);

// `line` without its end. Throws Garbled.
Greeting ParseGreeting(std::string_view line);

// A batch. The referenced outlive it.
struct Question {
  int dimension;                           // k
  const Eigen::MatrixXd& points;           // d x n; a flat's are its centers
  const Eigen::MatrixXd* bases = nullptr;  // (d k) x n: flats are asked for, else closest points
  const Eigen::VectorXd* radii = nullptr;  // n, with bases
  bool tangents = false, sizes = false;    // wanted beside the points
  int walls = 0;                           // of the oracle, whose clearances are wanted too
  Walls face = {};                         // points of a face are asked for, and conormals

  // Numbers that an answer has for each point, of walls.
  Eigen::Index wall_numbers() const { return walls + std::ssize(face) * points.rows(); }
};

std::string ToBytes(const Question& question, bool text);

// Reads the answer to one question, in whatever pieces it comes. Memory stays within a small
// multiple of a right answer's size.
class AnswerReader {
 public:
  static std::unique_ptr<AnswerReader> Make(const Question& question, bool text);
  virtual ~AnswerReader() = default;

  // Takes from the front of `bytes`. True once the answer is whole; what is left then came after
  // it. Throws Garbled; an error that the command reports is thrown as a CommandError.
  virtual bool Take(std::string* bytes) = 0;

  // After Take said true. Only what the question wanted, and finite wherever found.
  Answer Finish();

 protected:
  explicit AnswerReader(const Question& question) : question_(question) {}
  Eigen::Index n() const { return question_.points.cols(); }
  Eigen::Index d() const { return question_.points.rows(); }
  Eigen::Index dk() const { return d() * question_.dimension; }
  void MakeWalls();  // in the answer, of the question's sizes

  const Question question_;
  Answer answer_;
};

// In the command's own words.
struct CommandError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

}  // namespace stellate::pipe
