package stellate;

/**
 * A compact smooth k-submanifold M of R^d without boundary, 1 &lt;= k &lt; d, unless it is
 * WithWalls.
 *
 * <p>Methods take and fill whole batches, of found.length points, one after the other. The answer
 * to a query must not depend on the rest of its batch. Calls come one at a time unless the oracle
 * is concurrent(). What else an oracle can answer are the interfaces below.
 */
public interface Oracle {
  /** k */
  int dimension();

  /** d */
  int ambientDimension();

  /** Where to look for M: {lower, upper}; null if there are seeds(). */
  default double[][] boundingBox() {
    return null;
  }

  /** [m, d], points near M, one at least on each component; null if there is a boundingBox(). */
  default double[] seeds() {
    return null;
  }

  /** Whether several workers may call it at the same time. */
  default boolean concurrent() {
    return false;
  }

  /**
   * Writes a point of M nearest to each x [n, d] to points, and false to found, which comes as true
   * everywhere, where it has none.
   */
  void closestPoint(double[] x, double[] points, boolean[] found) throws Exception;

  /** An oracle that knows where M meets flats. */
  interface WithFlats extends Oracle {
    /**
     * The point of M nearest to each center [n, d] in the flat through it that is orthogonal to the
     * columns of its basis [n, d, k], within the radius [n].
     */
    void intersectFlat(
        double[] centers, double[] bases, double[] radii, double[] points, boolean[] found)
        throws Exception;
  }

  /** An oracle that knows tangent spaces. */
  interface WithTangents extends Oracle {
    /** At points [n, d] of M orthonormal columns: entry (row, column) is (i d + row) k + column. */
    void tangentBasis(double[] points, double[] bases) throws Exception;
  }

  /** An oracle that knows how large things are. */
  interface WithSizes extends Oracle {
    /** At points [n, d] of M the local feature size, or any positive lengths. */
    void localSize(double[] points, double[] sizes) throws Exception;
  }

  /**
   * An oracle of a manifold with boundary: it is where all walls are at least 0 on M^, a manifold
   * without one, which the other methods describe; it may be R^d. The walls of a face ascend.
   */
  interface WithWalls extends WithTangents {
    /** How many there are. */
    int walls();

    /** As closestPoint, of points of M^ where the walls of the face are 0, whatever others are. */
    void facePoint(double[] x, int[] face, double[] points, boolean[] found) throws Exception;

    /** The walls' values at points [n, d], whose signs count: [n, walls]. */
    void clearances(double[] points, double[] values) throws Exception;

    /**
     * At points of a face, of each of its walls the unit normal within the tangent space along
     * which the wall's value falls: [n, face.length, d].
     */
    void conormals(double[] points, int[] face, double[] normals) throws Exception;
  }
}
