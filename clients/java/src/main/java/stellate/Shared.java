package stellate;

import java.io.BufferedReader;
import java.io.IOException;
import java.io.InputStreamReader;
import java.io.UncheckedIOException;
import java.nio.charset.StandardCharsets;
import java.util.HashMap;
import java.util.Map;

/** A table of clients/shared, which the library carries: what all clients do alike. */
final class Shared {
  static final Shared RECONNECT = new Shared("reconnect.toml");
  static final Shared CHECKPOINT = new Shared("checkpoint.toml");

  private final Map<String, String> values = new HashMap<>();

  private Shared(String name) {
    try (var table = Shared.class.getResourceAsStream("/stellate/shared/" + name);
        var reader = new BufferedReader(new InputStreamReader(table, StandardCharsets.UTF_8))) {
      for (String line = reader.readLine(); line != null; line = reader.readLine()) {
        String[] parts = line.replaceFirst("#.*", "").split("=", 2);
        if (parts.length == 2) {
          values.put(parts[0].strip(), parts[1].strip().replace("\"", ""));
        }
      }
    } catch (IOException error) {
      throw new UncheckedIOException(error);
    }
  }

  String word(String key) {
    return values.get(key);
  }

  double number(String key) {
    return Double.parseDouble(values.get(key));
  }
}
