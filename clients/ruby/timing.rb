# frozen_string_literal: true

# For every line "EPSILON" on standard input meshes the torus on the server that is named, and prints
# "SECONDS VERTICES SIMPLICES".
require_relative 'lib/stellate'

$stdout.sync = true
client = Stellate::Client.new(ARGV.shift)
$stdin.each_line do |line|
  start = Process.clock_gettime(Process::CLOCK_MONOTONIC)
  mesh = Stellate.mesh(Stellate::Torus.new, epsilon: line.to_f, server: client)
  seconds = Process.clock_gettime(Process::CLOCK_MONOTONIC) - start
  puts "#{seconds} #{mesh.points.size} #{mesh.simplices.size}"
end
