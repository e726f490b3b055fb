# frozen_string_literal: true

Gem::Specification.new do |gem|
  gem.name = 'stellate'
  gem.version = '0.2.0'
  gem.summary = 'Meshes of smooth manifolds of any dimension, known through oracles alone'
  gem.authors = ['The maintainers of Stellate']
  gem.email = 'maintainers@stellate.example'
  gem.homepage = 'https://stellate.example'
  gem.license = 'Apache-2.0'
  gem.required_ruby_version = '>= 3.1'
  gem.files = Dir['lib/**/*.rb', 'README.md', 'LICENSE']
  gem.add_dependency 'google-protobuf', '>= 3.21'
  gem.add_dependency 'grpc', '>= 1.51'
  gem.metadata['bug_tracker_uri'] = 'https://stellate.example/issues'
  gem.metadata['source_code_uri'] = 'https://stellate.example/source'
  gem.metadata['rubygems_mfa_required'] = 'true'
end
