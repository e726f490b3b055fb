package stellate;

import com.google.gson.Gson;
import com.google.gson.reflect.TypeToken;
import java.io.BufferedReader;
import java.io.IOException;
import java.io.InputStream;
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

  /** A service config of gRPC, which takes it parsed. */
  static Map<String, Object> retries() {
    try (var reader = open("retries.json")) {
      return new Gson().fromJson(reader, new TypeToken<Map<String, Object>>() {}.getType());
    } catch (IOException error) {
      throw new UncheckedIOException(error);
    }
  }

  private static BufferedReader open(String name) {
    InputStream table = Shared.class.getResourceAsStream("/stellate/shared/" + name);
    return new BufferedReader(new InputStreamReader(table, StandardCharsets.UTF_8));
  }

  private Shared(String name) {
    try (var reader = open(name)) {
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
