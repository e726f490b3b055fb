#pragma once

#include <Eigen/Core>
#include <functional>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <string_view>

#include "stellate/error.h"
#include "stellate/oracle.h"

namespace stellate {

struct CommandOptions {
  std::string command;  // for /bin/sh -c
  int processes =
      1;  // of it, each with a batch of its own; as many threads may call the oracle in parallel

  // Where the command says them too, they have to be the same.
  std::optional<int> dimension, ambient_dimension;
  // Instead of the command's own.
  std::optional<BoundingBox> box;
  Eigen::MatrixXd seeds;  // d x m

  double start_seconds = 60;     // until its first line
  double silence_seconds = 600;  // in a batch, without a byte read or written by it

  // Ends the batches that are not answered within a second more, and with them the command.
  std::stop_token stop;
  // Called with how a process ended otherwise than in order, when it is started again; from the
  // thread that asked.
  std::function<void(const std::string&)> on_restart;
};

// An oracle that is a program in any language: it reads batches of queries from its standard input
// and writes the answers to its standard output. docs/using/pipe.md says how.
//
// A process that ends after it has answered a batch is started again and asked the same; once for
// a batch. Whatever else goes wrong is thrown by the oracle's methods as a std::runtime_error that
// says what, in which row, and what the command last wrote to its standard error. No process
// outlives the oracle.
//
// kRefused for options that make no sense or contradict the command, kOracleFailed for a command
// that does not begin as it should.
Expected<std::unique_ptr<Oracle>> StartCommand(const CommandOptions& options);

// "x1,...,xd:y1,...,yd", the lower and the upper corner; "x1,...,xd;y1,...,yd;...", points in
// columns.
Expected<BoundingBox> ParseBox(std::string_view text);
Expected<Eigen::MatrixXd> ParsePoints(std::string_view text);

}  // namespace stellate
