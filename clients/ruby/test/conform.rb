# frozen_string_literal: true

# Obeys tests/languages/conform.py: see there.
require_relative '../lib/stellate'

$stdout.sync = true
client = Stellate::Client.new(ARGV.shift, on_outage: ->(_said) {})

$stdin.each_line do |line|
  command, name, path = line.split
  mesh = nil
  begin
    if command == 'save'
      Stellate::Mesh.load_txt(name).save(path)
      puts 'saved'
      next
    end
    client.create(Stellate::Torus.new, epsilon: 1, label: name) if command == 'create'
    Stellate.watch(name, server: client) { |grown| mesh = grown }
  rescue Stellate::StellateError => e
    unless e.is_a?(Stellate::Cancelled) && e.mesh
      puts "error #{e.class.name.split('::').last} #{e.reason}"
      next
    end
    mesh = e.mesh
  end
  mesh.save(path)
  ended = Stellate::Wire.name(mesh.report.termination, 'TERMINATION_')
  level = Stellate::Wire.name(mesh.report.certificate&.level || 0, 'CERTIFICATE_LEVEL_')
  puts "mesh #{mesh.revision} #{ended} #{level}"
end
