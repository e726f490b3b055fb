# frozen_string_literal: true

require_relative 'live'

# Meshes, against the real server.
class MeshesTest < Minitest::Test
  def setup
    @server = Stellate::Server.start
    @client = Stellate::Client.new(@server)
  end

  def teardown
    @server.close
  end

  def test_same_meshes_as_python
    torus, clifford = Live.expected
    mesh = Stellate.mesh(Live::TORUS, epsilon: 0.1) # on a server of its own
    assert_equal torus, Live.counts(mesh)
    assert_predicate mesh, :certified?
    mesh = Stellate.mesh(Stellate::ProductOfCircles.new, epsilon: 0.3, server: @client, require_certified: true)
    assert_equal clifford, Live.counts(mesh)
    assert_equal 0, mesh.report.certificate.euler_characteristic
  end

  def test_intersections_and_sizes_by_several_workers
    sphere = Sphere.new
    mesh = Stellate.mesh(sphere, epsilon: 0.3, size_rate: 0.25, workers: 3, max_chunk: 50, server: @client)
    proved = mesh.report.certificate
    assert proved.certified, proved.verdict
    assert_equal 2, proved.euler_characteristic
    assert_operator proved.max_circumradius, :<=, 0.25
    assert_includes 1..50, sphere.sizes.max
  end

  def test_growing
    sizes, phases, last = [], [], nil
    on_progress = ->(progress) { phases |= [progress.phase] }
    Stellate.watch(Live::TORUS, epsilon: 0.1, server: @client, on_progress:) do |mesh|
      last = mesh
      sizes << mesh.points.size
    end
    assert_operator sizes.size, :>, 5
    assert_equal sizes.sort, sizes
    assert_equal Live.expected.first, Live.counts(last)
    assert_empty %i[PHASE_REFINING PHASE_DONE] - phases

    Stellate.watch(Live::TORUS, epsilon: 0.02, server: @client) { break } # who leaves takes the mesh along
    assert_empty @client.list.to_a
  end

  def test_call_by_call
    name = @client.create(Live::TORUS, epsilon: 0.1, label: 'by hand', random_seed: 7).name
    state = Thread.new { Stellate.serve(Live::TORUS, name, server: @server, worker: 'by hand') }
    watched = nil
    Stellate.watch(name, server: @client) { |mesh| watched = mesh }
    assert_equal 'SUCCEEDED', state.value
    assert_equal 'SUCCEEDED', @client.serve(Live::TORUS, name) # too late, and no error
    fetched = Stellate.download(name, server: @client)
    assert_equal watched.points, fetched.points
    assert_equal watched.simplices, fetched.simplices
    assert_predicate fetched, :certified?
    assert_includes @client.list(page_size: 1).map { |mesh| mesh.spec.label }, 'by hand'
    @client.delete(name)
    assert_raises(Stellate::MeshNotFound) { @client.get(name) }
  end

  def test_interrupted_with_the_mesh_so_far
    on_progress = ->(progress) { raise Interrupt if progress.vertices > 500 }
    error = assert_raises(Stellate::Cancelled) do
      Stellate.mesh(Live::TORUS, epsilon: 0.01, server: @client, on_progress:)
    end
    assert_operator error.mesh.points.size, :>, 500
  end

  def test_files
    Dir.mktmpdir do |folder|
      path = File.join(folder, 'torus.txt')
      mesh = Stellate.mesh(Live::TORUS, epsilon: 0.3, server: @client, save: path)
      numbers = File.read(path).split.map(&:to_f)
      assert_equal [2, 3, *Live.counts(mesh), *mesh.points.flatten, *mesh.simplices.flatten], numbers
      mesh.save(File.join(folder, 'torus.obj'))
      rows = File.readlines(File.join(folder, 'torus.obj')).grep(/^f/).map { |line| line.split[1..] }
      directed = rows.flat_map { |a, b, c| [[a, b], [b, c], [c, a]] }
      assert_equal 3 * mesh.simplices.size, directed.uniq.size # else two run along an edge the same way
      assert_raises(Stellate::SaveError) { mesh.save(File.join(folder, 'torus.vtu')) }
    end
  end
end
