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
  // Copies of it, each with a batch of its own; as many threads may call the oracle in parallel.
  int processes = 1;

  // If the command states them too, they must be equal.
  std::optional<int> dimension, ambient_dimension;
  // Instead of the command's own.
  std::optional<BoundingBox> box;
  Eigen::MatrixXd seeds;  // d x m

  double start_seconds = 60;     // until its first line
  double silence_seconds = 600;  // during a batch, without a byte read or written by it

  // Ends the command, and the batches that are not answered within one more second.
  std::stop_token stop;
  // Called with how a process ended unexpectedly, when it is started again; on the thread that sent
  // the batch.
  std::function<void(const std::string&)> on_restart;
  // Called with what is waited for, "waiting for the oracle command's first answer, to 40 closest
  // points, 5 s", once a process neither reads nor writes for so many seconds, and for 4 times what
  // its longest batch took; and again at each doubling. On the thread that waits.
  std::function<void(const std::string&)> on_waiting = {};
  double unremarked_seconds = 5;
};

// An oracle that is a program in any language: it reads batches of queries from its standard input
// and writes the answers to its standard output, as docs/using/pipe.md specifies.
//
//   auto oracle = stellate::StartCommand({.command = "python3 torus.py"});
//   if (oracle) mesh = stellate::MeshManifold(**oracle, options);
//
// A process that ends after it has answered a batch is started again, and asked the same batch once
// more. For any other failure the oracle's methods throw a std::runtime_error, which says what went
// wrong, in which row, and what the command last wrote to its standard error. No process outlives
// the oracle.
//
// kRefused: the options are invalid or contradict the command. kOracleFailed: the command does not
// begin as specified.
Expected<std::unique_ptr<Oracle>> StartCommand(const CommandOptions& options);

// Parse "x1,...,xd:y1,...,yd", the lower and the upper corner; and "x1,...,xd;y1,...,yd;...",
// points, which are returned in columns.
Expected<BoundingBox> ParseBox(std::string_view text);
Expected<Eigen::MatrixXd> ParsePoints(std::string_view text);

}  // namespace stellate
